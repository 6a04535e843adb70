"""Prediction over one down-sampled IMU interval: covariance first, from the state before, then the state.

Error state dynamics, with the attitude error δθ in the NED frame, R = R(q) and a = acc - b_a:

    δθ' = δθ - R b_g dt        δv' = δv - [R a]× δθ dt - R b_a dt        δp' = δp + δv dt

The process noise is the gyro noise on δθ and the accelerometer noise, rotated to NED, on δv (Solà 2017, section 7,
with the error on the global side).

Mirrors `predictCovariance` of PX4 v1.16 `EKF/covariance.cpp` and `predictState` of `EKF/ekf.cpp`; the products are
written out and not generated.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common import state
from fusetune.ekf2.filter.common.earth_rate import update_earth_rate
from fusetune.ekf2.filter.common.global_position import add_to_position, refresh_ellipsoid
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_RANGE
from fusetune.ekf2.filter.common.imu_rates import accel_bias, gyro_bias
from fusetune.ekf2.filter.covariance import INITIAL_WIND_UNCERTAINTY
from fusetune.ekf2.filter.measurement_update import constrain_covariance
from fusetune.ekf2.filter.quaternion_core.quaternion_limits import limit_states
from fusetune.ekf2.filter.quaternion_core.quaternion_prediction import follow_turn, predict_quaternion_covariance
from fusetune.ekf2.numerics.constants import ONE_G
from fusetune.ekf2.numerics.rotations import (
    component_in_body,
    quat_to_dcm,
    rotate_by_body_increment,
    rotate_to_earth,
)
from fusetune.ekf2.releases.by_release import by_release

THETA, VEL, POS, GB, AB = state.ATTITUDE, state.VELOCITY, state.POSITION, state.GYRO_BIAS, state.ACCEL_BIAS
"""Where the parts of the error state sit, by their signs in the equations."""

DYNAMIC_STATES = state.POSITION + 3
"""Attitude, velocity and position come first; all that follows has no dynamics."""

BAD_ACCEL_NOISE = 4.9
WIND_NOISE_HEIGHT_RATE_SCALER = 0.5
ACCEL_HORIZ_LPF_TIME_CONSTANT_S = 1.0
HEIGHT_RATE_LPF_TIME_CONSTANT_S = 10.0
OLD_GYRO_BIAS_LIMIT = math.radians(20.0)
FLAT_EARTH_VELOCITY_LIMIT = 1000.0


@kernel
def _unit_range(value):
    """Noise parameters act within [0, 1]."""
    return min(max(value, 0.0), 1.0)


@kernel
def _predict_error_covariance(ekf, params):
    imu = ekf.imu_delayed
    dt = 0.5 * (imu.delta_vel_dt + imu.delta_ang_dt)
    gyro_variance = _unit_range(params.EKF2_GYR_NOISE) ** 2
    normal_variance = _unit_range(params.EKF2_ACC_NOISE) ** 2
    bad = ekf.fs.bad_acc_vertical
    ax = BAD_ACCEL_NOISE**2 if bad or imu.delta_vel_clipping[0] else normal_variance
    ay = BAD_ACCEL_NOISE**2 if bad or imu.delta_vel_clipping[1] else normal_variance
    az = BAD_ACCEL_NOISE**2 if bad or imu.delta_vel_clipping[2] else normal_variance

    _propagate(ekf, dt)
    _add_imu_noise(ekf, dt, gyro_variance, ax, ay, az)
    _add_noise_of_others(ekf, params, dt, gyro_variance, ax, ay, az)
    constrain_covariance(ekf, params)


predict_covariance = by_release(_predict_error_covariance, "adds_quaternion_errors", predict_quaternion_covariance)
"""P ← F P Fᵀ + Q over `ekf.imu_delayed`, with PX4's rules of when bias, field, wind and terrain drift."""


@kernel
def _propagate(ekf, dt):
    """P ← F P Fᵀ in place; only attitude, velocity and position have dynamics.

    First F from the left, which takes every column by itself; the columns of the other states are final then. Those of
    the dynamic states still need Fᵀ from the right, which takes every row by itself.
    """
    imu = ekf.imu_delayed
    ax = (imu.delta_vel[0] / imu.delta_vel_dt - ekf.accel_bias[0]) * dt
    ay = (imu.delta_vel[1] / imu.delta_vel_dt - ekf.accel_bias[1]) * dt
    az = (imu.delta_vel[2] / imu.delta_vel_dt - ekf.accel_bias[2]) * dt
    u = rotate_to_earth(ekf.R_to_earth, ax, ay, az)
    _multiply_from_left(ekf, dt, u)
    _mirror_cross_covariances(ekf.P)
    _multiply_from_right(ekf, dt, u)


@kernel
def _multiply_from_left(ekf, dt, u):
    """P ← F P, with u = R a dt."""
    P, R = ekf.P, ekf.R_to_earth
    rxx, rxy, rxz = R[0, 0] * dt, R[0, 1] * dt, R[0, 2] * dt
    ryx, ryy, ryz = R[1, 0] * dt, R[1, 1] * dt, R[1, 2] * dt
    rzx, rzy, rzz = R[2, 0] * dt, R[2, 1] * dt, R[2, 2] * dt
    un, ue, ud = u
    for j in range(state.ERROR_STATE_SIZE):
        tn, te, td = P[THETA, j], P[THETA + 1, j], P[THETA + 2, j]
        vn, ve, vd = P[VEL, j], P[VEL + 1, j], P[VEL + 2, j]
        gx, gy, gz = P[GB, j], P[GB + 1, j], P[GB + 2, j]
        ax, ay, az = P[AB, j], P[AB + 1, j], P[AB + 2, j]
        P[THETA, j] = tn - (rxx * gx + rxy * gy + rxz * gz)
        P[THETA + 1, j] = te - (ryx * gx + ryy * gy + ryz * gz)
        P[THETA + 2, j] = td - (rzx * gx + rzy * gy + rzz * gz)
        P[VEL, j] = vn + (ud * te - ue * td) - (rxx * ax + rxy * ay + rxz * az)
        P[VEL + 1, j] = ve + (un * td - ud * tn) - (ryx * ax + ryy * ay + ryz * az)
        P[VEL + 2, j] = vd + (ue * tn - un * te) - (rzx * ax + rzy * ay + rzz * az)
        P[POS, j] += dt * vn
        P[POS + 1, j] += dt * ve
        P[POS + 2, j] += dt * vd


@kernel
def _mirror_cross_covariances(P):
    """Copy the covariances of dynamic states with others to below the diagonal."""
    for j in range(DYNAMIC_STATES, state.ERROR_STATE_SIZE):
        for i in range(DYNAMIC_STATES):
            P[j, i] = P[i, j]


@kernel
def _multiply_from_right(ekf, dt, u):
    """The block of the dynamic states times Fᵀ: position before velocity before attitude, of which it is formed.

    Exact above the diagonal, and mirrored below it in the end.
    """
    P, R = ekf.P, ekf.R_to_earth
    for i in range(DYNAMIC_STATES):
        P[i, POS] += dt * P[i, VEL]
        P[i, POS + 1] += dt * P[i, VEL + 1]
        P[i, POS + 2] += dt * P[i, VEL + 2]
    _multiply_velocity_from_right(ekf, THETA, dt, u)
    _multiply_velocity_from_right(ekf, VEL, dt, u)
    for i in range(3):
        gx, gy, gz = P[i, GB], P[i, GB + 1], P[i, GB + 2]
        for j in range(3):
            P[i, THETA + j] -= R[j, 0] * dt * gx + R[j, 1] * dt * gy + R[j, 2] * dt * gz
    for i in range(DYNAMIC_STATES):
        for j in range(DYNAMIC_STATES):
            if j > i:
                P[j, i] = P[i, j]


@kernel
def _multiply_velocity_from_right(ekf, first, dt, u):
    """The covariances with the velocity of three states from `first` on."""
    P, R = ekf.P, ekf.R_to_earth
    un, ue, ud = u
    for i in range(first, first + 3):
        tn, te, td = P[i, THETA], P[i, THETA + 1], P[i, THETA + 2]
        ax, ay, az = P[i, AB], P[i, AB + 1], P[i, AB + 2]
        cross = (ud * te - ue * td, un * td - ud * tn, ue * tn - un * te)
        for j in range(3):
            P[i, VEL + j] = P[i, VEL + j] + cross[j] - (R[j, 0] * dt * ax + R[j, 1] * dt * ay + R[j, 2] * dt * az)


@kernel
def _add_imu_noise(ekf, dt, gyro_variance, ax, ay, az):
    """Gyro noise on the attitude, accelerometer noise (variance per body axis) rotated onto the velocity."""
    P = ekf.P
    R = ekf.R_to_earth
    dt2 = dt * dt
    for i in range(3):
        P[THETA + i, THETA + i] += gyro_variance * dt2
        for j in range(i, 3):
            noise = dt2 * (R[i, 0] * R[j, 0] * ax + R[i, 1] * R[j, 1] * ay + R[i, 2] * R[j, 2] * az)
            P[state.VELOCITY + i, state.VELOCITY + j] += noise
            if j > i:
                P[state.VELOCITY + j, state.VELOCITY + i] = P[state.VELOCITY + i, state.VELOCITY + j]


@kernel
def _add_below(P, index, limit, noise):
    """Let a variance grow as long as it is below `limit`."""
    if P[index, index] < limit:
        P[index, index] += noise


@kernel
def _add_bias_noise(ekf, params, dt, gyro_variance, ax, ay, az):
    gyro_noise = (dt * _unit_range(params.EKF2_GYR_B_NOISE)) ** 2
    accel_noise = (dt * _unit_range(params.EKF2_ACC_B_NOISE)) ** 2
    for i in range(3):
        _add_below(ekf.P, state.GYRO_BIAS + i, gyro_variance, gyro_noise)
    _add_below(ekf.P, state.ACCEL_BIAS, ax, accel_noise)
    _add_below(ekf.P, state.ACCEL_BIAS + 1, ay, accel_noise)
    _add_below(ekf.P, state.ACCEL_BIAS + 2, az, accel_noise)


@kernel
def _add_field_noise(ekf, params, dt):
    limit = params.EKF2_MAG_NOISE**2
    earth_noise = (dt * _unit_range(params.EKF2_MAG_E_NOISE)) ** 2
    body_noise = (dt * _unit_range(params.EKF2_MAG_B_NOISE)) ** 2
    for i in range(3):
        _add_below(ekf.P, state.MAG_EARTH + i, limit, earth_noise)
        _add_below(ekf.P, state.MAG_BODY + i, limit, body_noise)


@kernel
def wind_noise(ekf, params, dt):
    """Variance (m²/s²) that the wind gains in `dt`: more while climbing or descending, since it changes with height."""
    density = _unit_range(params.EKF2_WIND_NSD) * (1.0 + WIND_NOISE_HEIGHT_RATE_SCALER * abs(ekf.height_rate_lpf))
    return density * density * dt


@kernel
def _add_wind_noise(ekf, params, dt):
    interval = ekf.imu_delayed.delta_vel_dt
    alpha = interval / (HEIGHT_RATE_LPF_TIME_CONSTANT_S + interval)
    ekf.height_rate_lpf += alpha * (ekf.vel[2] - ekf.height_rate_lpf)
    noise = wind_noise(ekf, params, dt)
    for i in range(2):
        _add_below(ekf.P, state.WIND + i, INITIAL_WIND_UNCERTAINTY**2, noise)


@kernel
def _add_terrain_noise(ekf, params):
    """Terrain changes with the ground covered; with the range finder as height reference it is the datum."""
    if ekf.height_sensor_ref == HEIGHT_REF_RANGE:
        return
    interval = ekf.imu_delayed.delta_vel_dt
    gradient = interval * params.EKF2_TERR_GRAD
    speed_squared = ekf.vel[0] ** 2 + ekf.vel[1] ** 2
    ekf.P[state.TERRAIN, state.TERRAIN] += (
        interval * params.EKF2_TERR_NOISE
    ) ** 2 + gradient * gradient * speed_squared


@kernel
def _add_noise_below_limits(ekf, params, dt, gyro_variance, ax, ay, az):
    _add_bias_noise(ekf, params, dt, gyro_variance, ax, ay, az)
    _add_field_noise(ekf, params, dt)
    _add_wind_noise(ekf, params, dt)
    _add_terrain_noise(ekf, params)


@kernel
def _add_noise_to_estimated(ekf, params, dt, gyro_variance, ax, ay, az):
    P = ekf.P
    gyro_noise = (dt * _unit_range(params.EKF2_GYR_B_NOISE)) ** 2
    accel_noise = (dt * _unit_range(params.EKF2_ACC_B_NOISE)) ** 2
    for i in range(3):
        if not ekf.gyro_bias_inhibit[i]:
            P[GB + i, GB + i] += gyro_noise
        if not ekf.accel_bias_inhibit[i]:
            P[AB + i, AB + i] += accel_noise
    if ekf.cs.mag:
        for i in range(3):
            P[state.MAG_EARTH + i, state.MAG_EARTH + i] += (dt * _unit_range(params.EKF2_MAG_E_NOISE)) ** 2
            P[state.MAG_BODY + i, state.MAG_BODY + i] += (dt * _unit_range(params.EKF2_MAG_B_NOISE)) ** 2
    if ekf.cs.wind:
        noise = wind_noise(ekf, params, dt)
        P[state.WIND, state.WIND] += noise
        P[state.WIND + 1, state.WIND + 1] += noise


_add_noise_of_others = by_release(_add_noise_below_limits, "adds_noise_to_estimated_states", _add_noise_to_estimated)
"""Let the states that have no dynamics drift, and the terrain with the ground covered."""


@kernel
def _gyro_bias_by_mean_interval(ekf, dt):
    return gyro_bias(ekf)


@kernel
def _gyro_bias_of_this_interval(ekf, dt):
    """The increment is taken off as it is, however long the interval."""
    return ekf.gyro_bias[0] / dt, ekf.gyro_bias[1] / dt, ekf.gyro_bias[2] / dt


_gyro_bias_over = by_release(_gyro_bias_by_mean_interval, "takes_bias_increments_off", _gyro_bias_of_this_interval)


@kernel
def _accel_bias_by_mean_interval(ekf, dt):
    return accel_bias(ekf)


@kernel
def _accel_bias_of_this_interval(ekf, dt):
    return ekf.accel_bias[0] / dt, ekf.accel_bias[1] / dt, ekf.accel_bias[2] / dt


_accel_bias_over = by_release(_accel_bias_by_mean_interval, "takes_bias_increments_off", _accel_bias_of_this_interval)


@kernel
def _finish_nothing(ekf, params):
    """v1.16 limits states as it fuses."""


@kernel
def _finish_by_params(ekf, params):
    limit_states(ekf, params.EKF2_GYR_B_LIM, params.EKF2_ABL_LIM)
    follow_turn(ekf)
    ekf.quaternion.mean_dt = ekf.dt_ekf_avg


@kernel
def _finish_by_fixed_limit(ekf, params):
    limit_states(ekf, OLD_GYRO_BIAS_LIMIT, params.EKF2_ABL_LIM)
    ekf.quaternion.mean_dt = ekf.dt_ekf_avg


_finish_prediction = by_release(
    _finish_nothing,
    "adds_quaternion_errors",
    by_release(_finish_by_params, "learns_gyro_bias_always", _finish_by_fixed_limit),
)
"""Limit the states, note how far the vehicle turned, and scale biases by the new mean interval."""


@kernel
def predict_state(ekf, params):
    """Integrate `ekf.imu_delayed` into attitude, velocity and position."""
    update_earth_rate(ekf)
    imu = ekf.imu_delayed
    R = ekf.R_to_earth
    earth_rate = ekf.earth_rate_ned
    dt = imu.delta_ang_dt
    rotation = ekf.scratch.quat_before
    bias = _gyro_bias_over(ekf, dt)
    for i in range(3):
        earth = component_in_body(R, i, earth_rate[0], earth_rate[1], earth_rate[2])
        rotation[i] = imu.delta_ang[i] - bias[i] * dt - earth * dt
    rotate_by_body_increment(ekf.q, rotation[0], rotation[1], rotation[2])
    quat_to_dcm(ekf.q, R)
    _integrate_velocity(ekf, params)
    _finish_prediction(ekf, params)


@kernel
def _velocity_increment(ekf, dt):
    """Specific force times `dt` (m/s, NED)."""
    imu, bias = ekf.imu_delayed, _accel_bias_over(ekf, dt)
    bx = imu.delta_vel[0] - bias[0] * dt
    by = imu.delta_vel[1] - bias[1] * dt
    bz = imu.delta_vel[2] - bias[2] * dt
    return rotate_to_earth(ekf.R_to_earth, bx, by, bz)


@kernel
def _integrate_over_ellipsoid(ekf, params):
    """Specific force, gravity, Coriolis and transport rate."""
    dt = ekf.imu_delayed.delta_vel_dt
    dvn, dve, dvd = _velocity_increment(ekf, dt)
    vn, ve, vd = ekf.vel[0], ekf.vel[1], ekf.vel[2]
    rate = ekf.earth_rate_ned
    refresh_ellipsoid(ekf)
    transverse = ekf.ellipsoid_transverse_radius + ekf.gpos_alt
    # earth rate enters twice (Coriolis), the rate of the local frame once
    wn = 2.0 * rate[0] + ve / transverse
    we = 2.0 * rate[1] - vn / (ekf.ellipsoid_meridian_radius + ekf.gpos_alt)
    wd = 2.0 * rate[2] - ve * ekf.ellipsoid_tan_lat / transverse
    vn_new = vn + dvn - (we * vd - wd * ve) * dt
    ve_new = ve + dve - (wd * vn - wn * vd) * dt
    vd_new = vd + dvd + (ONE_G - (wn * ve - we * vn)) * dt
    _move_on(ekf, vn_new, ve_new, vd_new, dt, params.EKF2_VEL_LIM)
    _filter_motion(ekf, dvn, dve, dt)


@kernel
def _integrate_over_flat_earth(ekf, params):
    """Specific force and gravity alone."""
    dt = ekf.imu_delayed.delta_vel_dt
    dvn, dve, dvd = _velocity_increment(ekf, dt)
    down = ekf.vel[2] + dvd + ONE_G * dt
    _move_on(ekf, ekf.vel[0] + dvn, ekf.vel[1] + dve, down, dt, FLAT_EARTH_VELOCITY_LIMIT)
    _filter_motion(ekf, dvn, dve, dt)


_integrate_velocity = by_release(_integrate_over_ellipsoid, "flies_over_flat_earth", _integrate_over_flat_earth)


@kernel
def _move_on(ekf, north, east, down, dt, limit):
    """Take the new velocity (m/s); position by the trapezoidal rule, of the velocity before it is limited."""
    vn, ve, vd = ekf.vel[0], ekf.vel[1], ekf.vel[2]
    add_to_position(ekf, 0.5 * (vn + north) * dt, 0.5 * (ve + east) * dt, 0.5 * (vd + down) * dt)
    ekf.vel[0] = min(max(north, -limit), limit)
    ekf.vel[1] = min(max(east, -limit), limit)
    ekf.vel[2] = min(max(down, -limit), limit)


@kernel
def _filter_horizontal_acceleration(ekf, dvn, dve, dt):
    alpha = dt / (ACCEL_HORIZ_LPF_TIME_CONSTANT_S + dt)
    ekf.accel_horiz_lpf[0] += alpha * (dvn / dt - ekf.accel_horiz_lpf[0])
    ekf.accel_horiz_lpf[1] += alpha * (dve / dt - ekf.accel_horiz_lpf[1])


@kernel
def _filter_new_height_rate(ekf, dt):
    alpha = dt / HEIGHT_RATE_LPF_TIME_CONSTANT_S
    ekf.height_rate_lpf = ekf.height_rate_lpf * (1.0 - alpha) + ekf.vel[2] * alpha


@kernel
def _leave_height_rate(ekf, dt):
    """It is filtered where the covariance is predicted."""


_filter_height_rate = by_release(_filter_new_height_rate, "adds_quaternion_errors", _leave_height_rate)


@kernel
def _sum_up_motion(ekf, dvn, dve, dt):
    """The horizontal acceleration is in m/s: a sum of increments that decays with a time constant of 1 s."""
    ekf.accel_horiz_lpf[0] = ekf.accel_horiz_lpf[0] * (1.0 - dt) + dvn
    ekf.accel_horiz_lpf[1] = ekf.accel_horiz_lpf[1] * (1.0 - dt) + dve
    _filter_height_rate(ekf, dt)


_filter_motion = by_release(_filter_horizontal_acceleration, "filters_motion_plainly", _sum_up_motion)
