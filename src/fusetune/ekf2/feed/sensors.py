"""What the estimator keeps of one sensor: samples on the way to the fusion time horizon, and the one that is due."""

import numpy as np

from fusetune.ekf2.feed.buffers import RING, RING_CAPACITY
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

EV_NOISE = np.dtype([("position", "f8"), ("velocity", "f8"), ("attitude", "f8"), ("mode", "i8")], align=True)
"""EKF2_EVP_NOISE (m), EKF2_EVV_NOISE (m/s), EKF2_EVA_NOISE (rad) and EKF2_EV_NOISE_MD."""


def sensor_memory(sample: np.dtype, *also: tuple) -> np.dtype:
    """One sensor's sub-record, `ekf.sensors.<sensor>`.

    ring : time stamps of the samples that wait, and their positions in the input array
    sample : the last that reached the fusion time horizon
    data_ready : whether it did so in this update
    newest_time_us : IMU time at which a sample was last buffered, 0 for never
    exists : whether any sample ever arrived
    withheld : whether its samples are judged but not used; only an experiment (`ekf2/replay/withholding.py`) sets it
    """
    common = [
        ("ring", RING),
        ("sample", sample),
        ("data_ready", "?"),
        ("newest_time_us", "i8"),
        ("exists", "?"),
        ("withheld", "?"),
    ]
    return np.dtype([*common, *also], align=True)


SENSOR_MEMORIES = {
    # by the place in the ring: what parameters said when the sample arrived
    "gnss": sensor_memory(GNSS_SAMPLE, ("yaw_offset_deg", "f8", (RING_CAPACITY,)), ("newest_yaw_time_us", "i8")),
    "mag": sensor_memory(MAG_SAMPLE),
    "baro": sensor_memory(BARO_SAMPLE),
    "range": sensor_memory(RANGE_SAMPLE),
    "flow": sensor_memory(FLOW_SAMPLE),
    "ev": sensor_memory(EV_SAMPLE, ("noise", EV_NOISE, (RING_CAPACITY,))),
    "airspeed": sensor_memory(AIRSPEED_SAMPLE),
    "auxvel": sensor_memory(AUXVEL_SAMPLE),
    # made from IMU samples, so they stand in no input array
    "drag": sensor_memory(DRAG_SAMPLE, ("made", DRAG_SAMPLE, (RING_CAPACITY,)), ("made_count", "i8")),
    "system_flags": sensor_memory(SYSTEM_FLAGS_SAMPLE),
}

SENSORS = np.dtype(list(SENSOR_MEMORIES.items()), align=True)
"""The estimator's sub-record `ekf.sensors`."""
