"""Resets of the yaw in v1.13: to the heading of the field, or to the course of a fixed wing.

Mirrors `resetMagHeading` and `realignYawGPS` of PX4 v1.13 `EKF/ekf_helper.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.gnss.gnss_position import reset_horizontal_position_to_gnss
from fusetune.ekf2.filter.aid_sources.gnss.gnss_velocity import reset_velocity_to_gnss
from fusetune.ekf2.filter.aid_sources.magnetometer.heading_or_field import (
    is_heading_wanted,
    reset_yaw_to_filtered_field,
)
from fusetune.ekf2.filter.common.conditions import is_north_east_aiding_active
from fusetune.ekf2.filter.common.field_parameters import MAG_TYPE_INDOOR
from fusetune.ekf2.filter.common.state import VELOCITY
from fusetune.ekf2.filter.common.timing import horizon_us
from fusetune.ekf2.filter.field_covariance import reset_field_covariance
from fusetune.ekf2.filter.resets.state_resets import reset_quat_state_yaw
from fusetune.ekf2.numerics.rotations import euler_yaw, rotate_to_earth, wrap_pi

COURSE_SPEED_MIN = 5.0
COURSE_ACCURACY_SHARE = 0.15
COURSE_ERROR_MAX = 0.5
BAD_EVENTS_UNTIL_FAULT = 2


@kernel
def reset_yaw_to_field(ekf, params):
    """Reset the yaw to the low-passed field, unless that was done in this update; return whether yaw may count on it.

    Indoors, without anything that needs the yaw, it counts as aligned as it is.
    """
    if horizon_us(ekf) == ekf.mag.flt_mag_align_start_time:
        return True
    if ekf.mag.counter == 0:
        return False
    if is_heading_wanted(ekf, params):
        reset_yaw_to_filtered_field(ekf, params)
        return True
    return int(params.EKF2_MAG_TYPE) == MAG_TYPE_INDOOR


@kernel
def realign_yaw_by_course(ekf, params):
    """Correct the yaw by the course where the two disagree badly; else take the field for what is measured now."""
    gnss = ekf.sensors.gnss.sample
    speed = math.hypot(gnss.vel[0], gnss.vel[1])
    accuracy = max(gnss.sacc, params.EKF2_GPS_V_NOISE)
    if not (speed > COURSE_SPEED_MIN and accuracy < COURSE_ACCURACY_SHARE * speed):
        return reset_yaw_to_field(ekf, params)
    error = wrap_pi(math.atan2(gnss.vel[1], gnss.vel[0]) - math.atan2(ekf.vel[1], ekf.vel[0]))
    ratio = ekf.aid.gnss_vel.test_ratio
    is_rejected = max(ratio[0], ratio[1]) > 1.0 and is_north_east_aiding_active(ekf)
    is_yaw_bad = abs(error) > COURSE_ERROR_MAX and is_rejected
    if is_yaw_bad:
        ekf.mag_modes.bad_yaw_events += 1
    if is_yaw_bad or not ekf.cs.yaw_align:
        _reset_yaw_to_course(ekf, params, gnss, speed, accuracy, error)
        ekf.mag_B[:] = 0.0
    sample = ekf.sensors.mag.sample.mag
    ekf.mag_I[0], ekf.mag_I[1], ekf.mag_I[2] = rotate_to_earth(ekf.R_to_earth, sample[0], sample[1], sample[2])
    reset_field_covariance(ekf, params)
    ekf.mag.flt_mag_align_start_time = horizon_us(ekf)
    if is_yaw_bad:
        reset_velocity_to_gnss(ekf, params)
        reset_horizontal_position_to_gnss(ekf, params)
    return True


@kernel
def _reset_yaw_to_course(ekf, params, gnss, speed, accuracy, error):
    """First in flight by as much as the courses differ, later to the course through the air; its variance follows."""
    cs = ekf.cs
    if cs.mag_aligned_in_flight and ekf.mag_modes.bad_yaw_events >= BAD_EVENTS_UNTIL_FAULT:
        cs.mag_fault = True
    if not cs.mag_aligned_in_flight:
        yaw = euler_yaw(ekf.R_to_earth) + error
        cs.mag_aligned_in_flight = True
    elif cs.wind:
        yaw = math.atan2(gnss.vel[1] - ekf.wind_vel[1], gnss.vel[0] - ekf.wind_vel[0])
    else:
        yaw = math.atan2(gnss.vel[1], gnss.vel[0])
    variance = accuracy * accuracy + ekf.P[VELOCITY, VELOCITY] + ekf.P[VELOCITY + 1, VELOCITY + 1]
    deviation = math.asin(min(math.sqrt(variance) / speed, 1.0))
    reset_quat_state_yaw(ekf, params, yaw, deviation * deviation)
