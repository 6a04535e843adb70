"""The heading that the magnetometer shows: its agreement with the yaw estimate, and resets of yaw to it.

The field's azimuth in the tilt-compensated frame is yaw-independent: with R = Rz(yaw) R_tilt, the measured heading is
`declination - azimuth(R_tilt m)` and the heading innovation is simply `azimuth(R m) - declination`.

Mirrors the heading part of PX4 v1.16 `EKF/aid_sources/magnetometer/mag_control.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import is_north_east_aiding_active
from fusetune.ekf2.filter.common.global_position import single_precision
from fusetune.ekf2.filter.common.state import MAG_BODY
from fusetune.ekf2.filter.resets.state_resets import reset_quat_state_yaw
from fusetune.ekf2.filter.world_field import get_mag_declination
from fusetune.ekf2.numerics.rotations import euler_yaw, rotate_to_earth, wrap_pi
from fusetune.ekf2.releases.by_release import by_release

HEADING_LPF_ALPHA = 0.1
YAW_VARIANCE_MIN = 0.01**2


@kernel
def _is_at_most(ekf, variance, limit):
    return variance <= limit


@kernel
def _is_at_most_in_single_precision(ekf, variance, limit):
    """After a reset the variance is the limit, and stays so while the noise is below the resolution of PX4's."""
    return single_precision(variance) <= single_precision(limit)


_is_no_more = by_release(_is_at_most, "puts_body_field_by_yaw_estimator", _is_at_most_in_single_precision)


@kernel
def is_mag_bias_good(ekf, params):
    """Whether every body-field variance is positive and no larger than the measurement noise allows."""
    P = ekf.P
    var_x, var_y, var_z = P[MAG_BODY, MAG_BODY], P[MAG_BODY + 1, MAG_BODY + 1], P[MAG_BODY + 2, MAG_BODY + 2]
    variance_limit = params.EKF2_MAG_NOISE * params.EKF2_MAG_NOISE
    return min(var_x, var_y, var_z) > 0.0 and _is_no_more(ekf, max(var_x, var_y, var_z), variance_limit)


@kernel
def field_azimuth(ekf, params, mag):
    """Azimuth (rad) of the bias-corrected body-frame field `mag` seen in the estimated earth frame."""
    bx, by, bz = 0.0, 0.0, 0.0
    if is_mag_bias_good(ekf, params):
        bx, by, bz = ekf.mag_B[0], ekf.mag_B[1], ekf.mag_B[2]
    x, y, z = mag[0] - bx, mag[1] - by, mag[2] - bz
    north, east, _ = rotate_to_earth(ekf.R_to_earth, x, y, z)
    return math.atan2(east, north)


@kernel
def measured_heading(ekf, params, x, y, z):
    """Heading (rad) that a body-frame field shows, as an angle from -π to π plus the declination."""
    north, east, _ = rotate_to_earth(ekf.R_to_earth, x, y, z)
    azimuth = wrap_pi(math.atan2(east, north) - euler_yaw(ekf.R_to_earth))
    return get_mag_declination(ekf, params) - azimuth


@kernel
def _is_any(ekf, params, innovation):
    return True


@kernel
def _is_within_noise(ekf, params, innovation):
    return abs(innovation) < params.EKF2_HEAD_NOISE


_is_present_small = by_release(_is_any, "doubts_present_heading", _is_within_noise)


@kernel
def _is_accelerating(ekf, params):
    acceleration = math.hypot(ekf.accel_horiz_lpf[0], ekf.accel_horiz_lpf[1])
    return is_north_east_aiding_active(ekf) and acceleration > params.EKF2_MAG_ACCLIM


@kernel
def _is_yaw_observable(ekf, params):
    return ekf.field_history.yaw_observable


_is_heading_told = by_release(_is_accelerating, "holds_yaw_observable", _is_yaw_observable)
"""Whether the vehicle accelerates enough for GNSS to tell the heading."""


@kernel
def _by_gnss(ekf):
    return is_north_east_aiding_active(ekf)


@kernel
def _by_gnss_or_vision(ekf):
    return is_north_east_aiding_active(ekf) or ekf.cs.ev_pos


is_course_told = by_release(_by_gnss, "observes_yaw_by_vision", _by_gnss_or_vision)
"""Whether something is fused by which accelerations tell the heading."""


@kernel
def update_yaw_observability(ekf, params):
    """Yaw becomes observable above twice EKF2_MAG_ACCLIM (m/s²) and remains so above EKF2_MAG_ACCLIM.

    Mirrors `checkYawAngleObservability` of PX4 v1.15 `EKF/mag_control.cpp`.
    """
    history = ekf.field_history
    limit = params.EKF2_MAG_ACCLIM if history.yaw_observable else 2.0 * params.EKF2_MAG_ACCLIM
    acceleration = math.hypot(ekf.accel_horiz_lpf[0], ekf.accel_horiz_lpf[1])
    history.yaw_observable = is_course_told(ekf) and acceleration > limit


@kernel
def check_mag_heading_consistency(ekf, params, mag):
    """Low-pass the heading innovation; consistent once it is small while the vehicle accelerates enough to tell."""
    innovation = 0.0
    if ekf.cs.yaw_align:
        innovation = wrap_pi(field_azimuth(ekf, params, mag) - get_mag_declination(ekf, params))
        ekf.mag.heading_innovation_lpf += HEADING_LPF_ALPHA * (innovation - ekf.mag.heading_innovation_lpf)
    else:
        ekf.mag.heading_innovation_lpf = 0.0

    if abs(ekf.mag.heading_innovation_lpf) < params.EKF2_HEAD_NOISE and _is_present_small(ekf, params, innovation):
        if _is_heading_told(ekf, params):
            ekf.cs.mag_heading_consistent = True
    else:
        ekf.cs.mag_heading_consistent = False


@kernel
def reset_mag_heading(ekf, params, mag):
    """Reset yaw to the heading of the body-frame field `mag` (Gauss), keeping roll and pitch."""
    yaw = euler_yaw(ekf.R_to_earth) - field_azimuth(ekf, params, mag) + get_mag_declination(ekf, params)
    variance = max(params.EKF2_HEAD_NOISE * params.EKF2_HEAD_NOISE, YAW_VARIANCE_MIN)
    reset_quat_state_yaw(ekf, params, yaw, variance)
    ekf.time_last_heading_fuse = ekf.time_delayed_us
    ekf.mag.heading_innovation_lpf = 0.0
    ekf.cs.mag_heading_consistent = True
