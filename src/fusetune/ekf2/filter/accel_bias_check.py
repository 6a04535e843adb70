"""Whether the accelerometer's bias is stuck at its limit on the wrong side, as releases until v1.15 ask.

A bias along the vertical that explained innovations would have their sign. One near the limit that height and vertical
velocity have contradicted for 7 s is in the way of what they tell.

Mirrors `checkVerticalAccelerationBias` of PX4 v1.15 `EKF/height_control.cpp`.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.timing import is_timed_out
from fusetune.ekf2.filter.covariance import reset_accel_bias_cov
from fusetune.ekf2.releases.by_release import by_release

ACCEL_BIAS_CHECK = np.dtype([("time_last_passed", "i8")], align=True)
"""Sub-record `ekf.accel_bias_check`: when the bias was last beyond doubt (µs)."""

SHARE_OF_LIMIT = 0.9
DOUBT_BEFORE_RESET_US = 7_000_000


@kernel
def down_accel_bias(ekf):
    """Component of `ekf.accel_bias` along the vertical, positive down, in its unit."""
    R, bias = ekf.R_to_earth, ekf.accel_bias
    return R[2, 0] * bias[0] + R[2, 1] * bias[1] + R[2, 2] * bias[2]


@kernel
def contradicts_height(ekf, down_bias):
    """Whether an innovation of a height that is fused has the other sign than a bias."""
    cs, aid = ekf.cs, ekf.aid
    return (
        (cs.baro_hgt and not ekf.sensors.baro.withheld and down_bias * aid.baro_hgt.innovation[0] < 0.0)
        or (cs.ev_hgt and down_bias * aid.ev_hgt.innovation[0] < 0.0)
        or (cs.gps_hgt and not ekf.sensors.gnss.withheld and down_bias * aid.gnss_hgt.innovation[0] < 0.0)
        or (cs.rng_hgt and down_bias * aid.rng_hgt.innovation[0] < 0.0)
    )


@kernel
def contradicts_vertical_velocity(ekf, down_bias, uses_vision):
    """Whether the vertical innovation of a velocity that is fused has the other sign than a bias."""
    cs, aid = ekf.cs, ekf.aid
    return (uses_vision and down_bias * aid.ev_vel.innovation[2] < 0.0) or (
        cs.gnss_vel and not ekf.sensors.gnss.withheld and down_bias * aid.gnss_vel.innovation[2] < 0.0
    )


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
