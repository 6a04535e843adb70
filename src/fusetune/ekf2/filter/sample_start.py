"""The start of v1.13: tilt by angles, heading by the low-passed field, height by the barometer.

Mirrors `initialiseFilter`, `initialiseTilt` of PX4 v1.13 `EKF/ekf.cpp` and `resetMagHeading` of `EKF/ekf_helper.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.field_parameters import MAG_TYPE_3D
from fusetune.ekf2.filter.resets.state_resets import reset_quat_state_yaw
from fusetune.ekf2.filter.world_field import get_mag_declination
from fusetune.ekf2.numerics.rotations import quat_to_dcm, rotate_to_earth, update_yaw_in_rot_mat


@kernel
def start_by_angles_and_field(ekf, params, levelling):
    """Set attitude, field and the barometer's height from what LEVELLING has low-passed."""
    _set_tilt(ekf, levelling.accel)
    ekf.cs.baro_hgt = True
    ekf.baro.lpf, ekf.baro.counter = levelling.baro_offset, levelling.baro_count
    ekf.sensors.baro.sample.time_us = levelling.baro_time_us
    ekf.sensors.baro.sample.hgt = levelling.baro_height
    ekf.heights.baro_time_us = levelling.baro_time_us
    ekf.mag.counter = levelling.mag_count
    for axis in range(3):
        ekf.mag.lpf[axis] = levelling.mag[axis]
    if int(params.EKF2_MAG_TYPE) <= MAG_TYPE_3D and levelling.mag_count > 0:
        _set_heading(ekf, params)


@kernel
def _set_tilt(ekf, specific_force):
    """Roll and pitch of a vehicle at rest, with a yaw of zero."""
    x, y, z = specific_force[0], specific_force[1], specific_force[2]
    pitch = math.asin(min(max(x / math.sqrt(x * x + y * y + z * z), -1.0), 1.0))
    roll = math.atan2(-y, -z)
    cr, sr, cp, sp = math.cos(0.5 * roll), math.sin(0.5 * roll), math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    ekf.q[0], ekf.q[1], ekf.q[2], ekf.q[3] = cr * cp, sr * cp, cr * sp, -sr * sp
    quat_to_dcm(ekf.q, ekf.R_to_earth)


@kernel
def _set_heading(ekf, params):
    """Turn to the heading of the low-passed field, and take that for the field of the Earth."""
    lpf, level = ekf.mag.lpf, ekf.scratch.R
    update_yaw_in_rot_mat(0.0, ekf.R_to_earth, level)
    north, east, _ = rotate_to_earth(level, lpf[0], lpf[1], lpf[2])
    reset_quat_state_yaw(ekf, params, -math.atan2(east, north) + get_mag_declination(ekf, params), 0.0)
    ekf.mag_I[0], ekf.mag_I[1], ekf.mag_I[2] = rotate_to_earth(ekf.R_to_earth, lpf[0], lpf[1], lpf[2])
    ekf.mag.flt_mag_align_start_time = ekf.time_delayed_us
