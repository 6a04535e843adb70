"""Fusion of a velocity measured in the body frame, axis by axis.

h = Rᵀ v; with the attitude error in the NED frame ∂h/∂θ = Rᵀ [v]× and ∂h/∂v = Rᵀ. All axes are linearised at the
first state, while innovations and their variances follow the updates. Mirrors PX4 v1.16 `fuseBodyFrameVelocity`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.state import ATTITUDE, VELOCITY
from fusetune.ekf2.filter.measurement_update import measurement_update
from fusetune.ekf2.filter.observation_gain import clear_jacobian, compute_innovation_variance, compute_kalman_gain
from fusetune.ekf2.numerics.rotations import component_in_body


@kernel
def predict_body_velocity(ekf, axis):
    """Velocity (m/s) along one body axis."""
    return component_in_body(ekf.R_to_earth, axis, ekf.vel[0], ekf.vel[1], ekf.vel[2])


@kernel
def compute_body_velocity_jacobian(ekf, jacobian):
    """Write, for each body axis, the derivatives by attitude error and velocity, shape (3, 6)."""
    R, v = ekf.R_to_earth, ekf.vel
    for axis in range(3):
        rx, ry, rz = R[0, axis], R[1, axis], R[2, axis]
        jacobian[axis, 0] = ry * v[2] - rz * v[1]
        jacobian[axis, 1] = rz * v[0] - rx * v[2]
        jacobian[axis, 2] = rx * v[1] - ry * v[0]
        jacobian[axis, 3] = rx
        jacobian[axis, 4] = ry
        jacobian[axis, 5] = rz


@kernel
def _load_jacobian(jacobian, axis, H):
    for i in range(3):
        H[ATTITUDE + i] = jacobian[axis, i]
        H[VELOCITY + i] = jacobian[axis, 3 + i]


@kernel
def fuse_body_frame_velocity(ekf, params, aid, time_us, measurement, variance, gate, jacobian):
    """Judge and fuse a body velocity (m/s, FRD); `jacobian` is work space of shape (3, 6)."""
    H = ekf.scratch.H
    compute_body_velocity_jacobian(ekf, jacobian)
    clear_jacobian(H)
    for axis in range(3):
        _load_jacobian(jacobian, axis, H)
        innovation_variance = compute_innovation_variance(ekf, H, variance[axis])
        innovation = predict_body_velocity(ekf, axis) - measurement[axis]
        set_axis(aid, axis, measurement[axis], variance[axis], innovation, innovation_variance)
    update_aid_source_status(ekf, aid, 3, time_us, gate)
    if aid.innovation_rejected:
        return
    for axis in range(3):
        _load_jacobian(jacobian, axis, H)
        if axis > 0:
            aid.innovation_variance[axis] = compute_innovation_variance(ekf, H, variance[axis])
        aid.innovation[axis] = predict_body_velocity(ekf, axis) - measurement[axis]
        compute_kalman_gain(ekf, H, aid.innovation_variance[axis])
        measurement_update(ekf, params, aid.observation_variance[axis], aid.innovation[axis])
    aid.fused = True
    aid.time_last_fuse = ekf.time_delayed_us
    ekf.time_last_hor_vel_fuse = ekf.time_delayed_us
    ekf.time_last_ver_vel_fuse = ekf.time_delayed_us
