"""What the optical flow aid source remembers between updates."""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.state import ERROR_STATE_SIZE

FLOW_MEMORY = np.dtype(
    [
        ("max_rate", "f8"),
        ("min_distance", "f8"),
        ("max_distance", "f8"),
        ("gyro_bias", "f8", (3,)),
        ("ref_body_rate", "f8", (3,)),
        ("vel_body", "f8", (2,)),
        ("vel_body_lpf", "f8", (2,)),
        ("rate_compensated", "f8", (2,)),
        ("counter", "i8"),
        ("H", "f8", (2, ERROR_STATE_SIZE)),
    ],
    align=True,
)
"""Sub-record `ekf.flow`.

Limits that the sensor reported (rad/s, m), bias of its gyro against the IMU (rad/s, opposite sign to the body rate),
velocities from flow (m/s, FRD), compensated rates (rad/s), samples seen since the start, and work space.
"""


@kernel
def initialise_flow_memory(flow):
    """No sample seen; limits as before the sensor reports its own."""
    flow.max_rate = 1.0
    flow.min_distance = 0.0
    flow.max_distance = 10.0
    for i in range(3):
        flow.gyro_bias[i] = 0.0
        flow.ref_body_rate[i] = 0.0
    for i in range(2):
        flow.vel_body[i] = 0.0
        flow.vel_body_lpf[i] = 0.0
        flow.rate_compensated[i] = 0.0
    flow.counter = 0
