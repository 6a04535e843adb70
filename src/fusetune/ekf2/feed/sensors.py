"""What the estimator keeps of one sensor: the sample that is due, and what it knows of the newest one."""

import numpy as np

from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.feed.sensor_samples import (
    AIRSPEED_SAMPLE,
    AUXVEL_SAMPLE,
    BARO_SAMPLE,
    DRAG_SAMPLE,
    EV_SAMPLE,
    FLOW_SAMPLE,
    GNSS_SAMPLE,
    MAG_SAMPLE,
    RANGE_SAMPLE,
    SYSTEM_FLAGS_SAMPLE,
)


def sensor_memory(sample: np.dtype, *also: tuple) -> np.dtype:
    """One sensor's sub-record, `ekf.sensors.<sensor>`.

    sample : the last that reached the fusion time horizon
    data_ready : whether it did so in this update
    newest_time_us : IMU time at which a sample was last buffered, 0 for never
    exists : whether any sample ever arrived
    withheld : whether its samples are judged but not used; only an experiment (`ekf2/replay/withholding.py`) sets it
    """
    common = [("sample", sample), ("newest_time_us", "i8"), *fields("?", "data_ready", "exists", "withheld")]
    return np.dtype([*common, *also], align=True)


SENSOR_MEMORIES = {
    "gnss": sensor_memory(GNSS_SAMPLE, ("newest_yaw_time_us", "i8")),
    "mag": sensor_memory(MAG_SAMPLE),
    "baro": sensor_memory(BARO_SAMPLE),
    "range": sensor_memory(RANGE_SAMPLE),
    "flow": sensor_memory(FLOW_SAMPLE),
    "ev": sensor_memory(EV_SAMPLE),
    "airspeed": sensor_memory(AIRSPEED_SAMPLE),
    "auxvel": sensor_memory(AUXVEL_SAMPLE),
    "drag": sensor_memory(DRAG_SAMPLE),
    "system_flags": sensor_memory(SYSTEM_FLAGS_SAMPLE),
}

SENSORS = np.dtype(list(SENSOR_MEMORIES.items()), align=True)
"""The estimator's sub-record `ekf.sensors`."""
