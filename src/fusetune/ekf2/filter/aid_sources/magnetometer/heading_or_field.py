"""Fusion of the magnetometer until v1.14, of the heading that it shows or of the field; and resets of the yaw to it.

Mirrors `runMagAndMagDeclFusions` and `resetMagHeading` of PX4 v1.14 `EKF/mag_control.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_fusion import (
    fuse_declination,
    fuse_mag,
    judge_mag,
    recover_from_bad_mag_covariance,
)
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_heading import is_course_told, measured_heading
from fusetune.ekf2.filter.common.field_parameters import MAG_TYPE_3D, MAG_TYPE_INDOOR
from fusetune.ekf2.filter.common.timing import horizon_us
from fusetune.ekf2.filter.field_covariance import reset_field_covariance
from fusetune.ekf2.filter.resets.state_resets import reset_quat_state_yaw
from fusetune.ekf2.filter.world_field import get_mag_declination
from fusetune.ekf2.filter.yaw_fusion import fuse_yaw, judge_angle
from fusetune.ekf2.numerics.rotations import euler_yaw, rotate_to_earth, wrap_pi

HEADING_VARIANCE_MIN = 1e-4
HEADING_DEVIATION_MIN = 1e-2
DECLINATION_DEVIATION_AT_FIRST = 0.02
DECLINATION_DEVIATION = 0.5


@kernel
def judge_heading(ekf, params, sample):
    """Judge the heading that a sample shows, without the body field."""
    x, y, z = sample[0] - ekf.mag_B[0], sample[1] - ekf.mag_B[1], sample[2] - ekf.mag_B[2]
    heading = measured_heading(ekf, params, x, y, z)
    innovation = wrap_pi(euler_yaw(ekf.R_to_earth) - heading)
    R = max(params.EKF2_HEAD_NOISE * params.EKF2_HEAD_NOISE, HEADING_VARIANCE_MIN)
    judge_angle(ekf, params, ekf.aid.mag_heading, heading, innovation, R)


@kernel
def fuse_heading(ekf, params, sample):
    """Fuse the heading that a sample shows."""
    judge_heading(ekf, params, sample)
    fuse_yaw(ekf, params, ekf.aid.mag_heading, ekf.scratch.H)


@kernel
def mag_variance(params):
    """Variance (Gauss²) of an axis."""
    return params.EKF2_MAG_NOISE * params.EKF2_MAG_NOISE


@kernel
def fuse_field(ekf, params, sample, update_all_states):
    """Fuse the field; the declination before it where its covariance is new, after it where it is wanted."""
    is_known = ekf.field_history.declination_fused
    if not is_known:
        _fuse_assumed_declination(ekf, params, DECLINATION_DEVIATION_AT_FIRST)
        ekf.field_history.declination_fused = True
    R_mag = mag_variance(params)
    if judge_mag(ekf, params, sample, R_mag):
        fuse_mag(ekf, params, sample, R_mag, update_all_states, True)
    else:
        recover_from_bad_mag_covariance(ekf, params, True)
    if is_known and ekf.cs.mag_dec:
        _fuse_assumed_declination(ekf, params, DECLINATION_DEVIATION)


@kernel
def _fuse_assumed_declination(ekf, params, deviation):
    fuse_declination(ekf, params, get_mag_declination(ekf, params), deviation * deviation, True)


@kernel
def is_heading_wanted(ekf, params):
    """Whether the magnetometer is to tell the yaw: indoors only where position needs one."""
    mag_type = int(params.EKF2_MAG_TYPE)
    return mag_type <= MAG_TYPE_3D or (mag_type == MAG_TYPE_INDOOR and is_course_told(ekf))


@kernel
def take_filtered_field(ekf):
    """Let the earth field be the low-passed measurement, turned by the present attitude."""
    lpf = ekf.mag.lpf
    ekf.mag_I[0], ekf.mag_I[1], ekf.mag_I[2] = rotate_to_earth(ekf.R_to_earth, lpf[0], lpf[1], lpf[2])


@kernel
def reset_yaw_to_filtered_field(ekf, params):
    """Set the yaw to the heading of the low-passed field, and the earth field to that; the body field stays."""
    lpf = ekf.mag.lpf
    yaw = measured_heading(ekf, params, lpf[0], lpf[1], lpf[2])
    reset_quat_state_yaw(ekf, params, yaw, max(params.EKF2_HEAD_NOISE, HEADING_DEVIATION_MIN) ** 2)
    take_filtered_field(ekf)
    reset_field_covariance(ekf, params)
    ekf.mag.flt_mag_align_start_time = horizon_us(ekf)
