"""The output predictor: attitude, velocity and position at the time of the newest IMU sample.

The filter lives at the fusion time horizon, some 0.2 s ago. The predictor integrates the newest IMU samples forward
and is steered so that, looked back at the horizon, it agrees with the filter: attitude through a correction of the
delta angles, velocity and position through a correction of the whole stored history (EKF2_TAU_VEL, EKF2_TAU_POS).
It feeds what the vehicle publishes (`vehicle_attitude`, `vehicle_local_position`) and never the filter.
Mirrors PX4 v1.16 `EKF/output_predictor/output_predictor.cpp`.

Positions are metres north, east and down of a global reference, which is moved when the filter resets its position;
in releases whose filter keeps its position local, of the origin.
A correction moves every stored velocity and position alike, so it is kept once, as an offset: the history holds
velocities and positions less the offset at the time they were stored.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.buffers import RING_CAPACITY
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.filter.common.imu_rates import accel_bias, gyro_bias
from fusetune.ekf2.numerics.constants import ONE_G
from fusetune.ekf2.numerics.geodesy import add_to_lat_lon, lat_lon_difference
from fusetune.ekf2.numerics.lever_arm import velocity_of_offset
from fusetune.ekf2.numerics.rotations import (
    quat_multiply,
    quat_multiply_inverse,
    quat_normalise,
    quat_to_dcm,
    rotate_by_body_increment,
    rotate_to_earth,
)
from fusetune.ekf2.releases.by_release import by_release

MIN_DT_S, MAX_DT_S = 1e-4, 0.03
MAX_TIME_CONSTANT_S = 10.0
FAR_RESET_M = 1e5
INTEGRAL_GAIN = 0.1

OUTPUT_SAMPLE = np.dtype([("q", "f8", (4,)), ("vel", "f8", (3,)), ("pos", "f8", (3,))], align=True)

OUTPUT_MEMORY = np.dtype(
    [
        ("history", OUTPUT_SAMPLE, (RING_CAPACITY,)),
        *fields("i8", "head", "tail", "size"),
        ("first_write", "?"),
        ("newest", OUTPUT_SAMPLE),
        *fields("f8", "vel_offset", "pos_offset", shape=(3,)),
        *fields("f8", "ref_lat", "ref_lon", "ref_alt"),
        ("R_to_earth", "f8", (3, 3)),
        *fields("f8", "gyro_bias", "accel_bias", "delta_angle_corr", "vel_err_integ", "pos_err_integ", shape=(3,)),
        ("vel_imu_rel_body", "f8", (3,)),
        ("q_work", "f8", (4,)),
        *fields("f8", "dt_update_avg", "dt_correct_avg"),
        *fields("i8", "time_last_update_us", "time_last_correct_us"),
    ],
    align=True,
)
"""The estimator's sub-record `ekf.output`."""


@kernel
def initialise_output_predictor(ekf):
    """Empty history as long as the IMU buffer; call after the buffers are sized."""
    output = ekf.output
    output.size = ekf.buffers.imu_length
    output.head = 0
    output.tail = 0
    output.first_write = True
    output.dt_update_avg = 0.005
    output.dt_correct_avg = 0.01
    output.newest.q[0] = 1.0
    for i in range(output.size):
        output.history[i].q[0] = 1.0
    for axis in range(3):
        output.R_to_earth[axis, axis] = 1.0


@kernel
def predict_output(output, params, imu, has_offset):
    """Integrate one IMU sample, IMU_ROW, at the full rate (PX4: calculateOutputStates).

    `has_offset` tells whether the IMU is away from the body's origin, or was until now.
    """
    if output.time_last_update_us != 0:
        dt = min(max((imu.time_us - output.time_last_update_us) * 1e-6, MIN_DT_S), MAX_DT_S)
        output.dt_update_avg = 0.8 * output.dt_update_avg + 0.2 * dt
    output.time_last_update_us = imu.time_us
    corrected = (
        imu.delta_ang[0] - output.gyro_bias[0] * imu.delta_ang_dt + output.delta_angle_corr[0],
        imu.delta_ang[1] - output.gyro_bias[1] * imu.delta_ang_dt + output.delta_angle_corr[1],
        imu.delta_ang[2] - output.gyro_bias[2] * imu.delta_ang_dt + output.delta_angle_corr[2],
    )
    newest = output.newest
    rotate_by_body_increment(newest.q, corrected[0], corrected[1], corrected[2])
    quat_to_dcm(newest.q, output.R_to_earth)
    _integrate_velocity(output, imu)
    if has_offset and imu.delta_ang_dt > 0.001:
        _velocity_of_imu_offset(output, params, corrected, imu.delta_ang_dt)


@kernel
def has_imu_offset(output, params):
    """Whether the IMU's place enters the published velocity."""
    vel = output.vel_imu_rel_body
    return (
        params.EKF2_IMU_POS_X != 0.0
        or params.EKF2_IMU_POS_Y != 0.0
        or params.EKF2_IMU_POS_Z != 0.0
        or vel[0] != 0.0
        or vel[1] != 0.0
        or vel[2] != 0.0
    )


@kernel
def _integrate_velocity(output, imu):
    """Velocity from the specific force, position by the trapezoidal rule."""
    newest = output.newest
    R = output.R_to_earth
    dt = imu.delta_vel_dt
    for axis in range(3):
        delta = 0.0
        for j in range(3):
            delta += R[axis, j] * (imu.delta_vel[j] - output.accel_bias[j] * dt)
        if axis == 2:
            delta += ONE_G * dt
        newest.pos[axis] += (newest.vel[axis] + 0.5 * delta) * dt
        newest.vel[axis] += delta


@kernel
def _velocity_of_imu_offset(output, params, delta_angle, dt):
    """Velocity of the IMU relative to the body's origin, NED: R (ω × r)."""
    wx, wy, wz = delta_angle[0] / dt, delta_angle[1] / dt, delta_angle[2] / dt
    x, y, z = velocity_of_offset(wx, wy, wz, params.EKF2_IMU_POS_X, params.EKF2_IMU_POS_Y, params.EKF2_IMU_POS_Z)
    vel = output.vel_imu_rel_body
    vel[0], vel[1], vel[2] = rotate_to_earth(output.R_to_earth, x, y, z)


@kernel
def _set_reference_here(ekf):
    ekf.output.ref_lat = ekf.gpos_lat
    ekf.output.ref_lon = ekf.gpos_lon
    ekf.output.ref_alt = ekf.gpos_alt


@kernel
def _leave_reference(ekf):
    """Local positions are of the origin."""


_set_reference = by_release(_set_reference_here, "keeps_position_local", _leave_reference)


@kernel
def _offset_from_reference(ekf):
    output = ekf.output
    north, east = lat_lon_difference(ekf.gpos_lat, ekf.gpos_lon, ekf.gpos_alt, output.ref_lat, output.ref_lon)
    return north, east, output.ref_alt - ekf.gpos_alt


@kernel
def _local_position(ekf):
    return ekf.local.north, ekf.local.east, -ekf.gpos_alt


_position = by_release(_offset_from_reference, "keeps_position_local", _local_position)
"""The filter's position (m, NED) as the history counts it."""


@kernel
def align_output_predictor(ekf):
    """Bring the whole history into agreement with the filter at the horizon (at filter start)."""
    output = ekf.output
    oldest = output.history[output.tail]
    quat_multiply_inverse(ekf.q, oldest.q, output.q_work)
    _set_reference(ekf)
    position = _position(ekf)
    for axis in range(3):
        output.vel_offset[axis] = ekf.vel[axis] - oldest.vel[axis]
        output.pos_offset[axis] = position[axis] - oldest.pos[axis]
    for i in range(output.size):
        _turn(output.history[i].q, output.q_work)
    newest, stored = output.newest, output.history[output.head]
    for i in range(4):
        newest.q[i] = stored.q[i]
    for axis in range(3):
        newest.vel[axis] = stored.vel[axis] + output.vel_offset[axis]
        newest.pos[axis] = stored.pos[axis] + output.pos_offset[axis]


@kernel
def correct_output(ekf, params):
    """Steer the predictor towards the filter, once per filter update (PX4: correctOutputStates)."""
    output = ekf.output
    if output.time_last_correct_us != 0:
        dt = min(max((ekf.time_delayed_us - output.time_last_correct_us) * 1e-6, MIN_DT_S), MAX_DT_S)
        output.dt_correct_avg = 0.8 * output.dt_correct_avg + 0.2 * dt
    output.time_last_correct_us = ekf.time_delayed_us
    gyro, accel = gyro_bias(ekf), accel_bias(ekf)
    for axis in range(3):
        output.gyro_bias[axis] = gyro[axis]
        output.accel_bias[axis] = accel[axis]
    _store_newest(output)
    _correct_attitude(ekf)
    _correct_velocity_and_position(ekf, params)


@kernel
def _store_newest(output):
    head = output.head
    if not output.first_write:
        head += 1
        if head >= output.size:
            head = 0
    output.head = head
    if head == output.tail and not output.first_write:
        output.tail = output.tail + 1 if output.tail + 1 < output.size else 0
    else:
        output.first_write = False
    stored, newest = output.history[head], output.newest
    for i in range(4):
        stored.q[i] = newest.q[i]
    for axis in range(3):
        stored.vel[axis] = newest.vel[axis] - output.vel_offset[axis]
        stored.pos[axis] = newest.pos[axis] - output.pos_offset[axis]


@kernel
def _correct_attitude(ekf):
    """Delta-angle correction that turns the predictor towards the filter's attitude at the horizon."""
    output = ekf.output
    q = ekf.q
    error = output.q_work
    error[0], error[1], error[2], error[3] = q[0], -q[1], -q[2], -q[3]
    quat_multiply(error, output.history[output.tail].q, error)
    scale = -2.0 if error[0] >= 0.0 else 2.0
    delay = max((output.time_last_update_us - ekf.time_delayed_us) * 1e-6, output.dt_update_avg)
    gain = 0.5 * output.dt_update_avg / delay
    for axis in range(3):
        output.delta_angle_corr[axis] = gain * scale * error[axis + 1]


@kernel
def _correct_velocity_and_position(ekf, params):
    """Move velocity and position, past and present, by a proportional-integral share of the error at the horizon."""
    output = ekf.output
    vel_gain = output.dt_correct_avg / min(max(params.EKF2_TAU_VEL, output.dt_correct_avg), MAX_TIME_CONSTANT_S)
    pos_gain = output.dt_correct_avg / min(max(params.EKF2_TAU_POS, output.dt_correct_avg), MAX_TIME_CONSTANT_S)
    pos = _position(ekf)
    oldest, newest = output.history[output.tail], output.newest
    for axis in range(3):
        vel_err = ekf.vel[axis] - (oldest.vel[axis] + output.vel_offset[axis])
        pos_err = pos[axis] - (oldest.pos[axis] + output.pos_offset[axis])
        output.vel_err_integ[axis] += vel_err
        output.pos_err_integ[axis] += pos_err
        vel_step = vel_err * vel_gain + output.vel_err_integ[axis] * vel_gain * vel_gain * INTEGRAL_GAIN
        pos_step = pos_err * pos_gain + output.pos_err_integ[axis] * pos_gain * pos_gain * INTEGRAL_GAIN
        output.vel_offset[axis] += vel_step
        output.pos_offset[axis] += pos_step
        newest.vel[axis] += vel_step
        newest.pos[axis] += pos_step


@kernel
def apply_quaternion_reset(ekf, q_change):
    """Turn the history by `q_change` (w, x, y, z; in NED)."""
    output = ekf.output
    for i in range(output.size):
        _turn(output.history[i].q, q_change)
    _turn(output.newest.q, q_change)


@kernel
def apply_velocity_reset(ekf, delta_north, delta_east, delta_down):
    """Add a velocity reset (m/s) to the history."""
    output = ekf.output
    step = (delta_north, delta_east, delta_down)
    for axis in range(3):
        output.vel_offset[axis] += step[axis]
        output.newest.vel[axis] += step[axis]


@kernel
def _move_reference(ekf, delta_north, delta_east, delta_down):
    """Horizontally the global reference moves, so the tracking error stays as it is.

    After a jump over a great distance (the first fix) it is set so that the error at the horizon is zero.
    """
    output = ekf.output
    if abs(delta_north) + abs(delta_east) < FAR_RESET_M:
        if delta_north != 0.0 or delta_east != 0.0:
            lat, lon = add_to_lat_lon(output.ref_lat, output.ref_lon, output.ref_alt, delta_north, delta_east)
            output.ref_lat = lat
            output.ref_lon = lon
    else:
        oldest, offset = output.history[output.tail].pos, output.pos_offset
        lat, lon = add_to_lat_lon(
            ekf.gpos_lat, ekf.gpos_lon, ekf.gpos_alt, -oldest[0] - offset[0], -oldest[1] - offset[1]
        )
        output.ref_lat = lat
        output.ref_lon = lon
    output.pos_offset[2] += delta_down
    output.newest.pos[2] += delta_down


@kernel
def _move_positions(ekf, delta_north, delta_east, delta_down):
    offset, newest = ekf.output.pos_offset, ekf.output.newest.pos
    offset[0] += delta_north
    offset[1] += delta_east
    offset[2] += delta_down
    newest[0] += delta_north
    newest[1] += delta_east
    newest[2] += delta_down


apply_position_reset = by_release(_move_reference, "keeps_position_local", _move_positions)
"""Follow a position reset (m) that the filter has just made."""


@kernel
def _turn(q, change):
    quat_multiply(change, q, q)
    quat_normalise(q)
