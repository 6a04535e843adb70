"""Prediction and fusion of optical flow: line-of-sight rates of the ground about the body X and Y axes.

With u = Rᵀ v the velocity in the body frame and h the height above ground, the predicted rates (rad/s) are
(u_y R₂₂ / h, -u_x R₂₂ / h). The derivatives by the attitude error follow from ∂u/∂θ = Rᵀ [v]× and
∂R₂₂/∂θ = (R₁₂, -R₀₂, 0); those by the heights from h = terrain - p_z.

Mirrors PX4 v1.16 `EKF/aid_sources/optical_flow/optical_flow_fusion.cpp`. Like there, the Jacobian neglects the
sensor's lever arm, which the innovation accounts for.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import get_hagl
from fusetune.ekf2.filter.common.state import ATTITUDE, POSITION, TERRAIN, VELOCITY
from fusetune.ekf2.filter.covariance import initialise_covariance
from fusetune.ekf2.filter.measurement_update import measurement_update
from fusetune.ekf2.filter.observation_gain import clear_jacobian, compute_innovation_variance, compute_kalman_gain
from fusetune.ekf2.numerics.lever_arm import position_relative_to_imu, velocity_of_offset
from fusetune.ekf2.numerics.rotations import component_in_earth, rotate_to_body
from fusetune.ekf2.releases.by_release import by_release

MIN_HAGL = 1e-2
MIN_CLEARANCE = 0.1
HAGL_EPSILON = 1e-3
MIN_FLOW_NOISE = 0.05
BEST_QUALITY = 255.0


@kernel
def flow_sensor_offset_body(params):
    """Position (m, FRD) of the flow sensor relative to the IMU."""
    return position_relative_to_imu(params, params.EKF2_OF_POS_X, params.EKF2_OF_POS_Y, params.EKF2_OF_POS_Z)


@kernel
def _flow_hagl(ekf, params):
    """Height (m) of the flow sensor above the terrain estimate."""
    px, py, pz = flow_sensor_offset_body(params)
    return get_hagl(ekf) - component_in_earth(ekf.R_to_earth, 2, px, py, pz)


@kernel
def _flow_hagl_of_any_sign(ekf, params):
    """The height above or below the terrain estimate, never less than 1 cm."""
    return max(abs(_flow_hagl(ekf, params)), MIN_HAGL)


@kernel
def _flow_hagl_beyond_clearance(ekf, params):
    """The height above the terrain estimate, never less than the vehicle has on the ground, nor 1 cm."""
    return max(_flow_hagl(ekf, params), params.EKF2_MIN_RNG, MIN_HAGL)


@kernel
def _flow_hagl_beyond_decimetre(ekf, params):
    """The height above the terrain estimate, never less than the vehicle has on the ground, nor 10 cm."""
    return max(_flow_hagl(ekf, params), params.EKF2_MIN_RNG, MIN_CLEARANCE)


predict_flow_hagl = by_release(
    by_release(_flow_hagl_of_any_sign, "flies_flow_over_terrain", _flow_hagl_beyond_clearance),
    "fuses_flow_at_once",
    _flow_hagl_beyond_decimetre,
)


@kernel
def predict_flow_range(ekf, params):
    """Distance (m) from the flow sensor to the ground along its optical axis."""
    return predict_flow_hagl(ekf, params) / ekf.R_to_earth[2, 2]


@kernel
def predict_flow(ekf, params, gyro_x, gyro_y, gyro_z):
    """Predicted rates (rad/s) about body X and Y, for a flow gyro reading (rad/s, minus the body rate)."""
    px, py, pz = flow_sensor_offset_body(params)
    offset_x, offset_y, _ = velocity_of_offset(-gyro_x, -gyro_y, -gyro_z, px, py, pz)
    forward, right, _ = rotate_to_body(ekf.R_to_earth, ekf.vel[0], ekf.vel[1], ekf.vel[2])
    scale = ekf.R_to_earth[2, 2] / predict_flow_hagl(ekf, params)
    return (right + offset_y) * scale, -(forward + offset_x) * scale


@kernel
def compute_flow_jacobian(ekf, axis, H):
    """Write the derivative of the predicted rate about body axis 0 or 1 into `H` (24,)."""
    R, v = ekf.R_to_earth, ekf.vel
    hagl = get_hagl(ekf)
    hagl += math.copysign(HAGL_EPSILON, hagl)
    body, sign = 1, 1.0
    if axis == 1:
        body, sign = 0, -1.0
    bx, by, bz = R[0, body], R[1, body], R[2, body]
    velocity = bx * v[0] + by * v[1] + bz * v[2]
    scale = sign * R[2, 2] / hagl
    by_tilt = sign * velocity / hagl
    clear_jacobian(H)
    H[ATTITUDE] = scale * (by * v[2] - bz * v[1]) + by_tilt * R[1, 2]
    H[ATTITUDE + 1] = scale * (bz * v[0] - bx * v[2]) - by_tilt * R[0, 2]
    H[ATTITUDE + 2] = scale * (bx * v[1] - by * v[0])
    H[VELOCITY] = scale * bx
    H[VELOCITY + 1] = scale * by
    H[VELOCITY + 2] = scale * bz
    by_height = -scale * velocity / hagl
    H[POSITION + 2] = -by_height
    H[TERRAIN] = by_height


@kernel
def calc_opt_flow_meas_var(params, quality):
    """Observation variance ((rad/s)²): the noise falls linearly from `EKF2_OF_N_MAX` at the least quality used."""
    best = max(params.EKF2_OF_N_MIN, MIN_FLOW_NOISE)
    worst = max(params.EKF2_OF_N_MAX, MIN_FLOW_NOISE)
    span = BEST_QUALITY - params.EKF2_OF_QMIN
    weight = 0.0
    if span >= 1.0:
        weight = min(max((quality - params.EKF2_OF_QMIN) / span, 0.0), 1.0)
    noise = best * weight + worst * (1.0 - weight)
    return noise * noise


@kernel
def _repredict_second_axis(ekf, params):
    """Account for what the first axis changed; the Jacobian of the second stays as first linearised."""
    aid, flow, gyro = ekf.aid.optical_flow, ekf.flow, ekf.sensors.flow.sample.gyro_rate
    aid.innovation_variance[1] = compute_innovation_variance(ekf, flow.H[1], aid.observation_variance[1])
    _, rate = predict_flow(
        ekf, params, gyro[0] - flow.gyro_bias[0], gyro[1] - flow.gyro_bias[1], gyro[2] - flow.gyro_bias[2]
    )
    aid.innovation[1] = rate - aid.observation[1]
    gate = params.EKF2_OF_GATE
    aid.test_ratio[1] = aid.innovation[1] * aid.innovation[1] / (gate * gate * aid.innovation_variance[1])


@kernel
def set_flow_rejection(ekf, x, y):
    """Note which axes were rejected."""
    ekf.reject.optflow_x = x
    ekf.reject.optflow_y = y


@kernel
def fuse_opt_flow(ekf, params, update_terrain):
    """Fuse the judged flow, X before Y; return whether it was fused.

    Close to the ground the model is far from linear, so that Y is tested anew after X has been fused, and left out
    where it fails.
    """
    aid, H = ekf.aid.optical_flow, ekf.flow.H
    if aid.innovation_rejected:
        set_flow_rejection(ekf, True, True)
        return False
    for axis in range(2):
        if axis == 1:
            _repredict_second_axis(ekf, params)
            if aid.test_ratio[1] > 1.0:
                continue
        if aid.innovation_variance[axis] < aid.observation_variance[axis]:
            initialise_covariance(ekf, params)
            return False
        compute_kalman_gain(ekf, H[axis], aid.innovation_variance[axis])
        if not update_terrain:
            ekf.scratch.K[TERRAIN] = 0.0
        measurement_update(ekf, params, aid.observation_variance[axis], aid.innovation[axis])
    ekf.fs.bad_optflow_x = False
    ekf.fs.bad_optflow_y = False
    set_flow_rejection(ekf, aid.test_ratio[0] > 1.0, aid.test_ratio[1] > 1.0)
    aid.time_last_fuse = ekf.time_delayed_us
    aid.fused = True
    ekf.time_last_hor_vel_fuse = ekf.time_delayed_us
    if update_terrain:
        ekf.time_last_terrain_fuse = ekf.time_delayed_us
    return True
