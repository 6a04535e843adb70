"""Whether the accelerometer's bias is stuck at its limit on the wrong side, as releases until v1.15 ask.

A bias along the vertical that explained innovations would have their sign. One near the limit that height and vertical
velocity have contradicted for 7 s is in the way of what they tell.

Mirrors `checkVerticalAccelerationBias` of PX4 v1.15 `EKF/height_control.cpp`.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.accel_bias_doubt import (
    DOUBT_BEFORE_RESET_US,
    SHARE_OF_LIMIT,
    contradicts_height,
    contradicts_vertical_velocity,
    down_accel_bias,
)
from fusetune.ekf2.filter.common.timing import is_timed_out
from fusetune.ekf2.filter.covariance import reset_accel_bias_cov
from fusetune.ekf2.releases.by_release import by_release

ACCEL_BIAS_CHECK = np.dtype([("time_last_passed", "i8")], align=True)
"""Sub-record `ekf.accel_bias_check`: when the bias was last beyond doubt (µs)."""


@kernel
def _trust_bias(ekf, params):
    """v1.16 does not look."""


@kernel
def _check_accel_bias(ekf, params):
    check, down_bias = ekf.accel_bias_check, down_accel_bias(ekf)
    doubtful = (
        abs(down_bias) > SHARE_OF_LIMIT * params.EKF2_ABL_LIM
        # PX4 asks whether the height of vision is fused, not its velocity
        and contradicts_vertical_velocity(ekf, down_bias, ekf.cs.ev_hgt)
        and contradicts_height(ekf, down_bias)
    )
    if not doubtful:
        check.time_last_passed = ekf.time_delayed_us
    elif is_timed_out(ekf, check.time_last_passed, DOUBT_BEFORE_RESET_US):
        reset_accel_bias_cov(ekf, params)
        check.time_last_passed = ekf.time_delayed_us


check_vertical_accel_bias = by_release(_trust_bias, "doubts_stuck_accel_bias", _check_accel_bias)
"""Give the accelerometer bias the variances of the start where it has been stuck for too long."""
