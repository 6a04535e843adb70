"""When a sensor message was measured: EKF2 reads the sample time of some topics, of others the time of publication."""

from __future__ import annotations

import numpy as np

from fusetune.px4.aid_sources import SENSOR_TOPICS
from fusetune.px4.flight import TopicTable


def is_stamped_by_sample(topic: str) -> bool:
    """Whether EKF2 takes the sample time of a topic's messages, not the time of their publication."""
    return topic in SENSOR_TOPICS and SENSOR_TOPICS[topic].stamped_by_sample


def measurement_time(topic: str, table: TopicTable) -> np.ndarray:
    """Time of each sample without the sensor's delay, (rows,) int64 µs.

    A sample time of zero counts as none.
    """
    timestamp = table["timestamp"].astype(np.int64)
    if not is_stamped_by_sample(topic) or "timestamp_sample" not in table:
        return timestamp
    sampled = table["timestamp_sample"].astype(np.int64)
    return np.where(sampled > 0, sampled, timestamp)
