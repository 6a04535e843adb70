"""Keep the yaw variance bounded while nothing observes the heading.

Mirrors PX4 v1.16 `EKF/aid_sources/zero_innovation_heading_update.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.state import ERROR_STATE_SIZE
from fusetune.ekf2.filter.common.timing import is_timed_out
from fusetune.ekf2.filter.covariance import initialise_covariance
from fusetune.ekf2.filter.measurement_update import measurement_update
from fusetune.ekf2.filter.observation_gain import multiply_covariance
from fusetune.ekf2.filter.yaw_fusion import compute_yaw_innov_var_and_h, fuse_yaw, judge_angle
from fusetune.ekf2.numerics.rotations import euler_yaw, wrap_pi
from fusetune.ekf2.releases.by_release import by_release

UPDATE_INTERVAL_US = 200_000
VARIANCE_WHILE_LEVELLING = 0.001
VARIANCE_AFTERWARDS = 0.25
VARIANCE_WHILE_LEVELLING_IN_MOTION = 0.1
VARIANCE_AT_REST = 0.01


@kernel
def _control_zero_innovation_heading_update(ekf, params):
    """Fuse a heading innovation of zero every 0.2 s, always while levelling, later only if the variance is large."""
    yaw_aiding = ekf.cs.mag_hdg or ekf.cs.mag_3d or ekf.cs.ev_yaw or ekf.cs.gnss_yaw
    if yaw_aiding or not is_timed_out(ekf, ekf.time_last_heading_fuse, UPDATE_INTERVAL_US):
        return
    variance = VARIANCE_AFTERWARDS if ekf.cs.tilt_align else VARIANCE_WHILE_LEVELLING
    H, K = ekf.scratch.H, ekf.scratch.K
    innovation_variance = compute_yaw_innov_var_and_h(ekf, variance, H)
    if ekf.cs.tilt_align and innovation_variance - variance <= params.EKF2_HEAD_NOISE**2:
        return
    if not innovation_variance >= variance:
        ekf.fs.bad_hdg = True
        initialise_covariance(ekf, params)
        return
    multiply_covariance(ekf, H)
    for i in range(ERROR_STATE_SIZE):
        K[i] = ekf.scratch.PH[i] / innovation_variance
    ekf.fs.bad_hdg = False
    ekf.reject.yaw = False
    measurement_update(ekf, params, variance, 0.0)
    ekf.time_last_heading_fuse = ekf.time_delayed_us


@kernel
def _hold_heading_otherwise(ekf, params):
    """A heading that nothing observes is held where gains and covariance are made."""


@kernel
def _hold_static_yaw(ekf, params):
    """At rest fuse the yaw at which the vehicle came to rest; while levelling and in motion an innovation of zero.

    Mirrors PX4 v1.14 `EKF/zero_innovation_heading_update.cpp`.
    """
    cs, modes = ekf.cs, ekf.mag_modes
    if not cs.tilt_align:
        variance = VARIANCE_WHILE_LEVELLING if cs.vehicle_at_rest else VARIANCE_WHILE_LEVELLING_IN_MOTION
        _fuse_yaw_difference(ekf, params, 0.0, variance)
        ekf.time_last_heading_fuse = 0
        modes.static_yaw = math.nan
        return
    yaw_aiding = cs.mag_hdg or cs.mag_3d or cs.ev_yaw or cs.gnss_yaw
    is_due = not yaw_aiding and is_timed_out(ekf, ekf.time_last_heading_fuse, UPDATE_INTERVAL_US)
    if cs.vehicle_at_rest:
        yaw = euler_yaw(ekf.R_to_earth)
        if not math.isfinite(modes.static_yaw):
            modes.static_yaw = yaw
        elif is_due:
            _fuse_yaw_difference(ekf, params, wrap_pi(yaw - modes.static_yaw), VARIANCE_AT_REST)
        return
    modes.static_yaw = math.nan
    if is_due:
        variance = compute_yaw_innov_var_and_h(ekf, VARIANCE_AFTERWARDS, ekf.scratch.H) - VARIANCE_AFTERWARDS
        if variance > params.EKF2_HEAD_NOISE * params.EKF2_HEAD_NOISE:
            _fuse_yaw_difference(ekf, params, 0.0, VARIANCE_AFTERWARDS)


@kernel
def _fuse_yaw_difference(ekf, params, innovation, variance):
    aid = ekf.mag_modes.held_yaw
    aid.time_last_fuse = 0
    judge_angle(ekf, params, aid, euler_yaw(ekf.R_to_earth) - innovation, innovation, variance)
    fuse_yaw(ekf, params, aid, ekf.scratch.H)


control_zero_innovation_heading_update = by_release(
    by_release(
        by_release(_control_zero_innovation_heading_update, "holds_unobservable_heading", _hold_heading_otherwise),
        "fuses_heading_or_field",
        _hold_static_yaw,
    ),
    "clears_field_whenever_stopped",
    _hold_heading_otherwise,
)
