"""When a sensor message was measured: EKF2 reads the sample time of some topics, of others the time of publication."""

from __future__ import annotations

import numpy as np

from fusetune.px4.flight import TopicTable

STAMPED_BY_SAMPLE = frozenset(
    {"vehicle_magnetometer", "vehicle_air_data", "airspeed", "vehicle_optical_flow", "vehicle_visual_odometry"}
)
"""Topics of which EKF2 takes `timestamp_sample`.

GNSS, range finders, validated airspeed and landing targets are stamped with `timestamp`, whatever their sample time
says; of GNSS that changed after v1.17.
"""


def measurement_time(topic: str, table: TopicTable) -> np.ndarray:
    """Time of each sample without the sensor's delay, (rows,) int64 µs.

    A sample time of zero counts as none.
    """
    timestamp = table["timestamp"].astype(np.int64)
    if topic not in STAMPED_BY_SAMPLE or "timestamp_sample" not in table:
        return timestamp
    sampled = table["timestamp_sample"].astype(np.int64)
    return np.where(sampled > 0, sampled, timestamp)
