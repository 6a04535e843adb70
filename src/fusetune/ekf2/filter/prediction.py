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
from fusetune.ekf2.filter.common.global_position import add_to_global_position, refresh_ellipsoid
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_RANGE
from fusetune.ekf2.filter.covariance import INITIAL_WIND_UNCERTAINTY
from fusetune.ekf2.filter.measurement_update import constrain_state_variances
from fusetune.ekf2.numerics.constants import ONE_G
from fusetune.ekf2.numerics.geodesy import earth_rate_ned
from fusetune.ekf2.numerics.rotations import (
    component_in_body,
    quat_to_dcm,
    rotate_by_body_increment,
    rotate_to_earth,
)

THETA, VEL, POS, GB, AB = state.ATTITUDE, state.VELOCITY, state.POSITION, state.GYRO_BIAS, state.ACCEL_BIAS
"""Where the parts of the error state sit, by their signs in the equations."""

DYNAMIC_STATES = state.POSITION + 3
"""Attitude, velocity and position come first; all that follows has no dynamics."""

EARTH_RATE_LATITUDE_STEP = math.radians(1.0)

BAD_ACCEL_NOISE = 4.9
WIND_NOISE_HEIGHT_RATE_SCALER = 0.5
ACCEL_HORIZ_LPF_TIME_CONSTANT_S = 1.0
HEIGHT_RATE_LPF_TIME_CONSTANT_S = 10.0


@kernel
def _unit_range(value):
    """Noise parameters act within [0, 1]."""
    return min(max(value, 0.0), 1.0)


@kernel
def predict_covariance(ekf, params):
    """P ← F P Fᵀ + Q over `ekf.imu_delayed`, with PX4's rules of when bias, field, wind and terrain drift."""
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
    _add_bias_noise(ekf, params, dt, gyro_variance, ax, ay, az)
    _add_field_noise(ekf, params, dt)
    _add_wind_noise(ekf, params, dt)
    _add_terrain_noise(ekf, params)
    constrain_state_variances(ekf, params)


@kernel
def _minus_row_of_cross_product_matrix(u, row):
    """A row of -[u]×."""
    if row == 0:
        return -0.0, u[2], -u[1]
    if row == 1:
        return -u[2], -0.0, u[0]
    return u[1], -u[0], -0.0


@kernel
def _propagate(ekf, dt):
    """P ← F P Fᵀ; only attitude, velocity and position have dynamics.

    `FP` holds their rows of F P, of which the columns of the other states are final already; their own still need Fᵀ
    from the right.
    """
    P = ekf.P
    R = ekf.R_to_earth
    A = ekf.scratch.FP
    imu = ekf.imu_delayed
    bx = (imu.delta_vel[0] / imu.delta_vel_dt - ekf.accel_bias[0]) * dt
    by = (imu.delta_vel[1] / imu.delta_vel_dt - ekf.accel_bias[1]) * dt
    bz = (imu.delta_vel[2] / imu.delta_vel_dt - ekf.accel_bias[2]) * dt
    u = rotate_to_earth(R, bx, by, bz)

    for i in range(3):
        r0, r1, r2 = R[i, 0] * dt, R[i, 1] * dt, R[i, 2] * dt
        m0, m1, m2 = _minus_row_of_cross_product_matrix(u, i)
        for j in range(state.ERROR_STATE_SIZE):
            A[THETA + i, j] = P[THETA + i, j] - (r0 * P[GB, j] + r1 * P[GB + 1, j] + r2 * P[GB + 2, j])
            A[VEL + i, j] = (
                P[VEL + i, j]
                + (m0 * P[THETA, j] + m1 * P[THETA + 1, j] + m2 * P[THETA + 2, j])
                - (r0 * P[AB, j] + r1 * P[AB + 1, j] + r2 * P[AB + 2, j])
            )
            A[POS + i, j] = P[POS + i, j] + dt * P[VEL + i, j]

    for i in range(DYNAMIC_STATES):
        for j in range(DYNAMIC_STATES, state.ERROR_STATE_SIZE):
            P[i, j] = A[i, j]
            P[j, i] = A[i, j]

    for j in range(3):
        r0, r1, r2 = R[j, 0] * dt, R[j, 1] * dt, R[j, 2] * dt
        m0, m1, m2 = _minus_row_of_cross_product_matrix(u, j)
        for i in range(THETA + j + 1):
            P[i, THETA + j] = A[i, THETA + j] - (r0 * A[i, GB] + r1 * A[i, GB + 1] + r2 * A[i, GB + 2])
            P[THETA + j, i] = P[i, THETA + j]
        for i in range(VEL + j + 1):
            P[i, VEL + j] = (
                A[i, VEL + j]
                + (m0 * A[i, THETA] + m1 * A[i, THETA + 1] + m2 * A[i, THETA + 2])
                - (r0 * A[i, AB] + r1 * A[i, AB + 1] + r2 * A[i, AB + 2])
            )
            P[VEL + j, i] = P[i, VEL + j]
        for i in range(POS + j + 1):
            P[i, POS + j] = A[i, POS + j] + dt * A[i, VEL + j]
            P[POS + j, i] = P[i, POS + j]


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
def _add_wind_noise(ekf, params, dt):
    """Wind drifts faster while climbing or descending, since it changes with height."""
    interval = ekf.imu_delayed.delta_vel_dt
    alpha = interval / (HEIGHT_RATE_LPF_TIME_CONSTANT_S + interval)
    ekf.height_rate_lpf += alpha * (ekf.vel[2] - ekf.height_rate_lpf)
    density = _unit_range(params.EKF2_WIND_NSD) * (1.0 + WIND_NOISE_HEIGHT_RATE_SCALER * abs(ekf.height_rate_lpf))
    noise = density * density * dt
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
def _update_earth_rate(ekf):
    """Earth rotation in NED (rad/s), looked up once per degree of latitude; zero until a latitude is known."""
    if abs(ekf.gpos_lat - ekf.earth_rate_lat_ref) > EARTH_RATE_LATITUDE_STEP:
        ekf.earth_rate_lat_ref = ekf.gpos_lat
        rate = ekf.earth_rate_ned
        rate[0], rate[1], rate[2] = earth_rate_ned(ekf.gpos_lat)


@kernel
def predict_state(ekf, params):
    """Integrate `ekf.imu_delayed` into attitude, velocity and global position."""
    _update_earth_rate(ekf)
    imu = ekf.imu_delayed
    R = ekf.R_to_earth
    earth_rate = ekf.earth_rate_ned
    dt = imu.delta_ang_dt
    rotation = ekf.scratch.quat_before
    for i in range(3):
        earth = component_in_body(R, i, earth_rate[0], earth_rate[1], earth_rate[2])
        rotation[i] = imu.delta_ang[i] - ekf.gyro_bias[i] * dt - earth * dt
    rotate_by_body_increment(ekf.q, rotation[0], rotation[1], rotation[2])
    quat_to_dcm(ekf.q, R)
    _integrate_velocity(ekf, params)


@kernel
def _integrate_velocity(ekf, params):
    """Specific force, gravity, Coriolis and transport rate; position by the trapezoidal rule."""
    imu = ekf.imu_delayed
    R = ekf.R_to_earth
    dt = imu.delta_vel_dt
    bx = imu.delta_vel[0] - ekf.accel_bias[0] * dt
    by = imu.delta_vel[1] - ekf.accel_bias[1] * dt
    bz = imu.delta_vel[2] - ekf.accel_bias[2] * dt
    dvn, dve, dvd = rotate_to_earth(R, bx, by, bz)

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

    add_to_global_position(ekf, 0.5 * (vn + vn_new) * dt, 0.5 * (ve + ve_new) * dt, 0.5 * (vd + vd_new) * dt)
    limit = params.EKF2_VEL_LIM
    ekf.vel[0] = min(max(vn_new, -limit), limit)
    ekf.vel[1] = min(max(ve_new, -limit), limit)
    ekf.vel[2] = min(max(vd_new, -limit), limit)

    alpha = dt / (ACCEL_HORIZ_LPF_TIME_CONSTANT_S + dt)
    ekf.accel_horiz_lpf[0] += alpha * (dvn / dt - ekf.accel_horiz_lpf[0])
    ekf.accel_horiz_lpf[1] += alpha * (dve / dt - ekf.accel_horiz_lpf[1])
