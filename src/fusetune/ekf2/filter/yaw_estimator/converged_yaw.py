"""Whether the yaw estimator has converged, and whether the filter's yaw contradicts it.

Mirrors the yaw part of PX4 v1.16 `EKF/aid_sources/gnss/gps_control.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.numerics.rotations import euler_yaw, wrap_pi

CONVERGED_YAW_DEVIATION = 0.262
"""Standard deviation (rad) below which the composite yaw counts as converged."""

YAW_FAILURE = math.radians(25.0)


@kernel
def is_yaw_emergency_estimate_available(ekf):
    """Whether the yaw estimator has converged."""
    variance = ekf.gsf.yaw_variance
    return ekf.gsf.vel_fuse_started and 0.0 < variance < CONVERGED_YAW_DEVIATION * CONVERGED_YAW_DEVIATION


@kernel
def is_yaw_failure(ekf):
    """Whether the filter's yaw is off the converged yaw estimator's by more than 25°."""
    if not is_yaw_emergency_estimate_available(ekf):
        return False
    return abs(wrap_pi(euler_yaw(ekf.R_to_earth) - ekf.gsf.yaw)) > YAW_FAILURE
