"""What the optical flow aid source remembers between updates."""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.filter.common.state import ERROR_STATE_SIZE

FLOW_MEMORY = np.dtype(
    [
        *fields("f8", "max_rate", "min_distance", "max_distance"),
        *fields("f8", "gyro_bias", "ref_body_rate", shape=(3,)),
        *fields("f8", "vel_body", "vel_body_lpf", "rate_compensated", shape=(2,)),
        ("counter", "i8"),
        ("H", "f8", (2, ERROR_STATE_SIZE)),
    ],
    align=True,
)
"""Sub-record `ekf.flow`.

Limits that the sensor reported (rad/s, m), bias of its gyro against the IMU (rad/s, opposite sign to the body rate),
velocities from flow (m/s, FRD), compensated rates (rad/s), samples seen since the start, and work space.
"""

FLOW_RATES = np.dtype([("compensated_lpf", "f8", (2,))], align=True)
"""Sub-record `ekf.flow_rates`, since v1.17: the compensated rates (rad/s), low-passed like the velocities."""


@kernel
def initialise_flow_memory(flow):
    """What is not zero at start: limits as before the sensor reports its own."""
    flow.max_rate = 1.0
    flow.max_distance = 10.0
