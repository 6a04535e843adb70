"""Prediction of the covariance with the quaternion's elements as states.

With h half the rotation over the interval and a the velocity increment, both without bias:

    q' = q ⊗ (1, h)        v' = v + R(q) a + g dt        p' = p + v dt

whose derivatives F by the states and G by the noise of the increments give P ← F P Fᵀ + G Q Gᵀ. Gyro noise reaches q by
½ q ⊗ (0, e), so with σ² (I - q qᵀ) / 4; the accelerometer's reaches v by R.

Mirrors `predictCovariance` of PX4 v1.14 `EKF/covariance.cpp`; the products are written out and not generated.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common import state
from fusetune.ekf2.filter.quaternion_core.core_memory import Q3
from fusetune.ekf2.filter.quaternion_core.quaternion_limits import limit_covariance
from fusetune.ekf2.releases.by_release import by_release

VEL, POS, GB, AB = state.VELOCITY, state.POSITION, state.GYRO_BIAS, state.ACCEL_BIAS

BAD_ACCEL_NOISE = 4.9
MOST_FIELD_VARIANCE = 0.1
MOST_WIND_VARIANCE = 1.0
MOST_POSITION_VARIANCE = 1e4
WIND_NOISE_HEIGHT_RATE_SCALER = 0.5
TURN_RATE_LPF_ALPHA = 0.05


@kernel
def _unit_range(value):
    return min(max(value, 0.0), 1.0)


@kernel
def predict_quaternion_covariance(ekf, params):
    """P ← F P Fᵀ + Q over `ekf.imu_delayed`, by the mean interval and not by that of this sample."""
    P, dt = ekf.P, ekf.quaternion.mean_dt
    _filter_height_rate(ekf, dt)
    is_held = P[POS, POS] + P[POS + 1, POS + 1] > MOST_POSITION_VARIANCE
    if is_held:
        _keep_position(ekf)
    field_noise = _field_noise(ekf, params, dt)
    wind_noise = _wind_noise(ekf, params, dt)
    _propagate(ekf, dt)
    _add_imu_noise(ekf, params, dt)
    _add_bias_noise(ekf, params, dt)
    if ekf.cs.mag_3d:
        for i in range(3):
            P[state.MAG_EARTH + i, state.MAG_EARTH + i] += field_noise[0]
            P[state.MAG_BODY + i, state.MAG_BODY + i] += field_noise[1]
    P[state.WIND, state.WIND] += wind_noise
    P[state.WIND + 1, state.WIND + 1] += wind_noise
    if is_held:
        _put_position_back(ekf)
    limit_covariance(ekf, params)


@kernel
def _filter_height_rate(ekf, dt):
    alpha = 0.1 * dt
    ekf.height_rate_lpf = ekf.height_rate_lpf * (1.0 - alpha) + ekf.vel[2] * alpha


@kernel
def _add_turn(modes, about_down, dt):
    modes.turn += about_down
    modes.turn_rate_lpf += TURN_RATE_LPF_ALPHA * (about_down / dt - modes.turn_rate_lpf)


@kernel
def follow_turn(ekf):
    """Sum and low-pass the turn about the vertical, of `ekf.scratch.quat_before` (rad, body), after the state moved."""
    R, turn = ekf.R_to_earth, ekf.scratch.quat_before
    about_down = turn[0] * R[2, 0] + turn[1] * R[2, 1] + turn[2] * R[2, 2]
    _add_turn(ekf.mag_modes, about_down, ekf.imu_delayed.delta_ang_dt)


@kernel
def _leave_newest_turn(ekf, imu):
    """The turn is that of the horizon, or of no use."""


@kernel
def _follow_newest_turn(ekf, imu):
    """Add the sample before, which an update between the two has not seen yet."""
    modes, output = ekf.mag_modes, ekf.output
    if modes.newest_dt > 0.0:
        about_down = 0.0
        for i in range(3):
            turn = modes.newest_turn[i] - output.gyro_bias[i] * modes.newest_dt + output.delta_angle_corr[i]
            about_down += turn * modes.newest_down[i]
        _add_turn(modes, about_down, modes.newest_dt)
    modes.newest_dt = imu.delta_ang_dt
    for i in range(3):
        modes.newest_turn[i] = imu.delta_ang[i]
        modes.newest_down[i] = output.R_to_earth[2, i]


follow_newest_turn = by_release(_leave_newest_turn, "follows_newest_turn", _follow_newest_turn)
"""Sum and low-pass the turn about the vertical by the newest IMU samples, each before the output predictor has it."""


@kernel
def _keep_position(ekf):
    """Where the position is hardly known any more, its covariances do not grow further."""
    for j in range(state.ERROR_STATE_SIZE):
        ekf.scratch.K[j] = ekf.P[POS, j]
        ekf.scratch.PH[j] = ekf.P[POS + 1, j]


@kernel
def _put_position_back(ekf):
    P, north, east = ekf.P, ekf.scratch.K, ekf.scratch.PH
    for j in range(state.ERROR_STATE_SIZE):
        P[POS, j] = north[j]
        P[j, POS] = north[j]
    for j in range(state.ERROR_STATE_SIZE):
        P[POS + 1, j] = east[j]
        P[j, POS + 1] = east[j]


@kernel
def _field_noise(ekf, params, dt):
    """Variances that the field and its bias gain; none of what is uncertain enough."""
    P, earth, body = ekf.P, state.MAG_EARTH, state.MAG_BODY
    earth_noise, body_noise = 0.0, 0.0
    if P[earth, earth] + P[earth + 1, earth + 1] + P[earth + 2, earth + 2] < MOST_FIELD_VARIANCE:
        earth_noise = (dt * _unit_range(params.EKF2_MAG_E_NOISE)) ** 2
    if P[body, body] + P[body + 1, body + 1] + P[body + 2, body + 2] < MOST_FIELD_VARIANCE:
        body_noise = (dt * _unit_range(params.EKF2_MAG_B_NOISE)) ** 2
    return earth_noise, body_noise


@kernel
def _wind_noise(ekf, params, dt):
    P, wind = ekf.P, state.WIND
    if not ekf.cs.wind or P[wind, wind] + P[wind + 1, wind + 1] >= MOST_WIND_VARIANCE:
        return 0.0
    return _wind_noise_in(ekf, params, dt, 1.0 + WIND_NOISE_HEIGHT_RATE_SCALER * abs(ekf.height_rate_lpf))


@kernel
def _wind_noise_by_density(ekf, params, dt, scale):
    density = _unit_range(params.EKF2_WIND_NSD) * scale
    return density * density * dt


@kernel
def _wind_noise_by_update(ekf, params, dt, scale):
    noise = dt * _unit_range(params.EKF2_WIND_NOISE) * scale
    return noise * noise


_wind_noise_in = by_release(_wind_noise_by_density, "adds_wind_noise_by_update", _wind_noise_by_update)


@kernel
def _propagate(ekf, dt):
    """P ← F P Fᵀ in place: F from the left takes every column by itself, Fᵀ from the right every row."""
    imu, q = ekf.imu_delayed, ekf.q
    h = (
        0.5 * (imu.delta_ang[0] - ekf.gyro_bias[0]),
        0.5 * (imu.delta_ang[1] - ekf.gyro_bias[1]),
        0.5 * (imu.delta_ang[2] - ekf.gyro_bias[2]),
    )
    x, y, z = (
        2.0 * (imu.delta_vel[0] - ekf.accel_bias[0]),
        2.0 * (imu.delta_vel[1] - ekf.accel_bias[1]),
        2.0 * (imu.delta_vel[2] - ekf.accel_bias[2]),
    )
    # ∂(R a)/∂q, of R with ones on its diagonal, a row for each of v
    q0, q1, q2, q3 = q[0], q[1], q[2], q[3]
    D = (
        (q2 * z - q3 * y, q2 * y + q3 * z, q1 * y + q0 * z - 2.0 * q2 * x, q1 * z - q0 * y - 2.0 * q3 * x),
        (q3 * x - q1 * z, q2 * x - q0 * z - 2.0 * q1 * y, q1 * x + q3 * z, q0 * x + q2 * z - 2.0 * q3 * y),
        (q1 * y - q2 * x, q3 * x + q0 * y - 2.0 * q1 * z, q3 * y - q0 * x - 2.0 * q2 * z, q1 * x + q2 * y),
    )
    half_q = (0.5 * q0, 0.5 * q1, 0.5 * q2, 0.5 * q3)
    _multiply_from_left(ekf, dt, h, half_q, D)
    _mirror_cross_covariances(ekf)
    _multiply_from_right(ekf, dt, h, half_q, D)


@kernel
def _multiply_from_left(ekf, dt, h, half_q, D):
    """P ← F P: the rows of quaternion, velocity and position."""
    P, R = ekf.P, ekf.R_to_earth
    hx, hy, hz = h
    w, x, y, z = half_q
    (dn0, dn1, dn2, dn3), (de0, de1, de2, de3), (dd0, dd1, dd2, dd3) = D
    rxx, rxy, rxz = R[0, 0], R[0, 1], R[0, 2]
    ryx, ryy, ryz = R[1, 0], R[1, 1], R[1, 2]
    rzx, rzy, rzz = R[2, 0], R[2, 1], R[2, 2]
    for j in range(state.ERROR_STATE_SIZE):
        p0, p1, p2, p3 = P[0, j], P[1, j], P[2, j], P[Q3, j]
        vn, ve, vd = P[VEL, j], P[VEL + 1, j], P[VEL + 2, j]
        gx, gy, gz = P[GB, j], P[GB + 1, j], P[GB + 2, j]
        ax, ay, az = P[AB, j], P[AB + 1, j], P[AB + 2, j]
        P[0, j] = p0 - (hx * p1 + hy * p2 + hz * p3) + (x * gx + y * gy + z * gz)
        P[1, j] = p1 + (hx * p0 + hz * p2 - hy * p3) - (w * gx - z * gy + y * gz)
        P[2, j] = p2 + (hy * p0 - hz * p1 + hx * p3) - (z * gx + w * gy - x * gz)
        P[Q3, j] = p3 + (hz * p0 + hy * p1 - hx * p2) - (x * gy - y * gx + w * gz)
        P[VEL, j] = vn + (dn0 * p0 + dn1 * p1 + dn2 * p2 + dn3 * p3) - (rxx * ax + rxy * ay + rxz * az)
        P[VEL + 1, j] = ve + (de0 * p0 + de1 * p1 + de2 * p2 + de3 * p3) - (ryx * ax + ryy * ay + ryz * az)
        P[VEL + 2, j] = vd + (dd0 * p0 + dd1 * p1 + dd2 * p2 + dd3 * p3) - (rzx * ax + rzy * ay + rzz * az)
        P[POS, j] += dt * vn
        P[POS + 1, j] += dt * ve
        P[POS + 2, j] += dt * vd


@kernel
def _mirror_cross_covariances(ekf):
    """Copy the covariances of states that have dynamics with those that have none, of what is estimated."""
    _mirror(ekf, GB, state.MAG_EARTH)
    if ekf.cs.mag_3d:
        _mirror(ekf, state.MAG_EARTH, state.WIND)
    if ekf.cs.wind:
        _mirror(ekf, state.WIND, Q3)


@kernel
def _mirror(ekf, first, last):
    P = ekf.P
    for j in range(first, last):
        for i in range(GB):
            P[j, i] = P[i, j]
        P[j, Q3] = P[Q3, j]


@kernel
def _multiply_from_right(ekf, dt, h, half_q, D):
    """The block of quaternion, velocity and position times Fᵀ, each of these before those that it is made of.

    Exact in rows of the quaternion, then of the velocity up to the diagonal; the others mirror them.
    """
    P = ekf.P
    for i in range(GB):
        _position_from_right(ekf, i, dt)
    _position_from_right(ekf, Q3, dt)
    for i in range(POS):
        _velocity_from_right(ekf, i, D)
    _velocity_from_right(ekf, Q3, D)
    for i in range(3):
        _quaternion_from_right(ekf, i, h, half_q)
    _quaternion_from_right(ekf, Q3, h, half_q)
    P[1, 0], P[2, 0], P[2, 1] = P[0, 1], P[0, 2], P[1, 2]
    for i in range(3):
        P[Q3, i] = P[i, Q3]
        for j in range(VEL, GB):
            P[j, i] = P[i, j]
    for j in range(VEL, GB):
        P[j, Q3] = P[Q3, j]
    for i in range(VEL, GB):
        for j in range(i + 1, GB):
            P[j, i] = P[i, j]


@kernel
def _position_from_right(ekf, i, dt):
    P = ekf.P
    P[i, POS] += dt * P[i, VEL]
    P[i, POS + 1] += dt * P[i, VEL + 1]
    P[i, POS + 2] += dt * P[i, VEL + 2]


@kernel
def _velocity_from_right(ekf, i, D):
    P, R = ekf.P, ekf.R_to_earth
    p0, p1, p2, p3 = P[i, 0], P[i, 1], P[i, 2], P[i, Q3]
    ax, ay, az = P[i, AB], P[i, AB + 1], P[i, AB + 2]
    for k in range(3):
        d0, d1, d2, d3 = D[k]
        turned = d0 * p0 + d1 * p1 + d2 * p2 + d3 * p3
        P[i, VEL + k] = P[i, VEL + k] + turned - (R[k, 0] * ax + R[k, 1] * ay + R[k, 2] * az)


@kernel
def _quaternion_from_right(ekf, i, h, half_q):
    P = ekf.P
    hx, hy, hz = h
    w, x, y, z = half_q
    p0, p1, p2, p3 = P[i, 0], P[i, 1], P[i, 2], P[i, Q3]
    gx, gy, gz = P[i, GB], P[i, GB + 1], P[i, GB + 2]
    P[i, 0] = p0 - (hx * p1 + hy * p2 + hz * p3) + (x * gx + y * gy + z * gz)
    P[i, 1] = p1 + (hx * p0 + hz * p2 - hy * p3) - (w * gx - z * gy + y * gz)
    P[i, 2] = p2 + (hy * p0 - hz * p1 + hx * p3) - (z * gx + w * gy - x * gz)
    P[i, Q3] = p3 + (hz * p0 + hy * p1 - hx * p2) - (x * gy - y * gx + w * gz)


@kernel
def _add_imu_noise(ekf, params, dt):
    """Noise of the increments: of the gyro on the quaternion, of the accelerometer, rotated, on the velocity."""
    P, R, q = ekf.P, ekf.R_to_earth, ekf.q
    angle_variance = (dt * _unit_range(params.EKF2_GYR_NOISE)) ** 2
    share = 0.25 * angle_variance
    for i in range(3):
        P[i, i] += share
        for j in range(3):
            P[i, j] -= share * (q[i] * q[j])
        P[i, Q3] -= share * (q[i] * q[3])
        P[Q3, i] -= share * (q[i] * q[3])
    P[Q3, Q3] += share * (1.0 - q[3] * q[3])
    normal, bad = (dt * _unit_range(params.EKF2_ACC_NOISE)) ** 2, (dt * BAD_ACCEL_NOISE) ** 2
    clipping, is_bad = ekf.imu_delayed.delta_vel_clipping, ekf.fs.bad_acc_vertical
    ax = bad if is_bad or clipping[0] else normal
    ay = bad if is_bad or clipping[1] else normal
    az = bad if is_bad or clipping[2] else normal
    for i in range(3):
        for j in range(3):
            P[VEL + i, VEL + j] += R[i, 0] * R[j, 0] * ax + R[i, 1] * R[j, 1] * ay + R[i, 2] * R[j, 2] * az


@kernel
def _add_bias_noise(ekf, params, dt):
    """Biases drift; one that is not learnt keeps the variance it had, and is correlated with nothing.

    PX4 sums the noise with compensation for what single precision loses, which double precision does not.
    """
    P, core = ekf.P, ekf.quaternion
    gyro_noise = (dt * dt * _unit_range(params.EKF2_GYR_B_NOISE)) ** 2
    accel_noise = (dt * dt * _unit_range(params.EKF2_ACC_B_NOISE)) ** 2
    for i in range(3):
        if ekf.gyro_bias_inhibit[i]:
            _hold(P, GB + i, core.kept_gyro_bias_var[i])
        else:
            P[GB + i, GB + i] += gyro_noise
        if ekf.accel_bias_inhibit[i]:
            _hold(P, AB + i, core.kept_accel_bias_var[i])
        else:
            P[AB + i, AB + i] += accel_noise


@kernel
def _hold(P, index, variance):
    for j in range(state.ERROR_STATE_SIZE):
        P[index, j] = 0.0
        P[j, index] = 0.0
    P[index, index] = variance
