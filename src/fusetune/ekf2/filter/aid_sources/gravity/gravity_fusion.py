"""Gravity as an observation of tilt while nothing else bounds the horizontal velocity.

The unit vector of the specific force stands for h = Rᵀ (0, 0, -1). With the attitude error in the NED frame,
∂h/∂θ = Rᵀ [(0, 0, -1)]×, so axis i depends on the errors about north and east alone, by (-R₁ᵢ, R₀ᵢ).

Mirrors PX4 v1.16 `EKF/aid_sources/gravity/gravity_fusion.cpp`: the aid source is judged and counted as fused at
every update, even while its flag is off; the axes are fused one after the other, all linearised at the first state.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.conditions import IMU_CTRL_GRAVITY_VECTOR, is_horizontal_aiding_active
from fusetune.ekf2.filter.common.imu_rates import specific_force
from fusetune.ekf2.filter.common.state import ATTITUDE, ERROR_STATE_SIZE
from fusetune.ekf2.filter.measurement_update import measurement_update
from fusetune.ekf2.filter.observation_gain import (
    clear_jacobian,
    compute_kalman_gain,
)
from fusetune.ekf2.filter.quaternion_core.attitude_jacobians import attitude_variance, complete_attitude_jacobian
from fusetune.ekf2.numerics.constants import FLT_EPSILON, ONE_G
from fusetune.ekf2.releases.by_release import by_release

GRAVITY_MEMORY = np.dtype([("jacobian", "f8", (3, 2))], align=True)
"""Sub-record `ekf.gravity`: of each body axis, the derivative by the attitude errors about north and east."""

ACCEL_LIMIT_LOW = 0.9 * ONE_G
ACCEL_LIMIT_HIGH = 1.1 * ONE_G
GRAVITY_GATE = 0.25
GATE_OF_ACCELERATION = 1.0
MIN_NOISE = 0.01


@kernel
def compute_gravity_jacobian(ekf, jacobian):
    """Write the derivative of each body axis of the up vector by the errors about north and east, shape (3, 2)."""
    for axis in range(3):
        jacobian[axis, 0] = -ekf.R_to_earth[1, axis]
        jacobian[axis, 1] = ekf.R_to_earth[0, axis]


@kernel
def _innovation_variance(ekf, jacobian, axis, R):
    north, east = jacobian[axis, 0], jacobian[axis, 1]
    P, n, e = ekf.P, ATTITUDE, ATTITUDE + 1
    return P[n, n] * north * north + 2.0 * P[n, e] * north * east + P[e, e] * east * east + R


@kernel
def _update_gravity(ekf, params):
    """Judge the specific force at the fusion time horizon as an observation of the vertical."""
    imu, aid, jacobian = ekf.imu_delayed, ekf.aid.gravity, ekf.gravity.jacobian
    x, y, z = specific_force(ekf)
    norm = math.sqrt(x * x + y * y + z * z)
    variance = max(params.EKF2_GRAV_NOISE * params.EKF2_GRAV_NOISE, MIN_NOISE * MIN_NOISE)
    measurement = (x / norm, y / norm, z / norm)
    compute_gravity_jacobian(ekf, jacobian)
    for axis in range(3):
        innovation = -ekf.R_to_earth[2, axis] - measurement[axis]
        innovation_variance = _innovation_variance(ekf, jacobian, axis, variance)
        set_axis(aid, axis, measurement[axis], variance, innovation, innovation_variance)
    update_aid_source_status(ekf, aid, 3, imu.time_us, GRAVITY_GATE)


@kernel
def _fuse_gravity(ekf, params):
    aid, jacobian, H = ekf.aid.gravity, ekf.gravity.jacobian, ekf.scratch.H
    clear_jacobian(H)
    for axis in range(3):
        if axis > 0:
            aid.innovation_variance[axis] = _innovation_variance(ekf, jacobian, axis, aid.observation_variance[axis])
            aid.innovation[axis] = -ekf.R_to_earth[2, axis] - aid.observation[axis]
        H[ATTITUDE] = jacobian[axis, 0]
        H[ATTITUDE + 1] = jacobian[axis, 1]
        compute_kalman_gain(ekf, H, aid.innovation_variance[axis])
        measurement_update(ekf, params, aid.observation_variance[axis], aid.innovation[axis])


@kernel
def _tell_fused(ekf, was_fused):
    ekf.aid.gravity.fused = True
    ekf.aid.gravity.time_last_fuse = ekf.imu_delayed.time_us


@kernel
def _tell_if_fused(ekf, was_fused):
    if was_fused:
        _tell_fused(ekf, was_fused)


_note_fusion = by_release(_tell_fused, "tells_fused_gravity", _tell_if_fused)


@kernel
def _control_gravity_fusion(ekf, params):
    """Hold the tilt to the vertical while the vehicle hardly accelerates and no other source aids horizontally."""
    accel_norm_good = ACCEL_LIMIT_LOW < ekf.accel_magnitude_filt < ACCEL_LIMIT_HIGH
    ekf.cs.gravity_vector = (
        (int(params.EKF2_IMU_CTRL) & IMU_CTRL_GRAVITY_VECTOR) != 0
        and (accel_norm_good or ekf.cs.vehicle_at_rest)
        and not is_horizontal_aiding_active(ekf)
    )
    _update_gravity(ekf, params)
    fused = _may_be_fused(ekf)
    if fused:
        _fuse_gravity(ekf, params)
    _note_fusion(ekf, fused)


@kernel
def _may_be_fused(ekf):
    imu = ekf.imu_delayed
    clipping = imu.delta_vel_clipping[0] != 0 or imu.delta_vel_clipping[1] != 0 or imu.delta_vel_clipping[2] != 0
    return ekf.cs.gravity_vector and not ekf.aid.gravity.innovation_rejected and not clipping


@kernel
def _control_steady_gravity(ekf, params):
    """As v1.16's, but with the mean specific force, after alignment, and fused only where it says so."""
    aid, force = ekf.aid.gravity, ekf.levelling.specific_force
    squared = force[0] * force[0] + force[1] * force[1] + force[2] * force[2]
    accel_norm_good = ACCEL_LIMIT_LOW * ACCEL_LIMIT_LOW < squared < ACCEL_LIMIT_HIGH * ACCEL_LIMIT_HIGH
    ekf.cs.gravity_vector = (
        (int(params.EKF2_IMU_CTRL) & IMU_CTRL_GRAVITY_VECTOR) != 0
        and (accel_norm_good or ekf.cs.vehicle_at_rest)
        and not is_horizontal_aiding_active(ekf)
        and ekf.cs.tilt_align
    )
    _update_gravity(ekf, params)
    if _may_be_fused(ekf):
        _fuse_gravity(ekf, params)
        aid.fused = True
        aid.time_last_fuse = ekf.imu_delayed.time_us


@kernel
def _control_acceleration_of_gravity(ekf, params):
    """As v1.16's, but gravity is observed in m/s²; by the mean force, with gains that are all of before the first."""
    aid, force = ekf.aid.gravity, ekf.quaternion.mean_force
    norm = math.sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2])
    ekf.cs.gravity_vector = (
        (int(params.EKF2_IMU_CTRL) & IMU_CTRL_GRAVITY_VECTOR) != 0
        and (ACCEL_LIMIT_LOW <= norm <= ACCEL_LIMIT_HIGH or ekf.cs.vehicle_at_rest)
        and not is_horizontal_aiding_active(ekf)
    )
    _update_acceleration_of_gravity(ekf, params)
    if ekf.cs.gravity_vector and not aid.innovation_rejected and _fuse_by_kept_gains(ekf, params):
        aid.fused = True
        aid.time_last_fuse = ekf.imu_delayed.time_us


@kernel
def _update_acceleration_of_gravity(ekf, params):
    """Judge the specific force as Rᵀ (0, 0, -g)."""
    imu, aid, H = ekf.imu_delayed, ekf.aid.gravity, ekf.scratch.H
    measured = specific_force(ekf)
    x, y, z = measured
    scale = ONE_G / math.sqrt(x * x + y * y + z * z + FLT_EPSILON * FLT_EPSILON)
    variance = params.EKF2_GRAV_NOISE * params.EKF2_GRAV_NOISE
    clear_jacobian(H)
    for axis in range(3):
        _write_jacobian_of_acceleration(ekf, axis, H)
        innovation = -ONE_G * ekf.R_to_earth[2, axis] - scale * measured[axis]
        set_axis(aid, axis, measured[axis], variance, innovation, attitude_variance(ekf, H) + variance)
    update_aid_source_status(ekf, aid, 3, imu.time_us, GATE_OF_ACCELERATION)


@kernel
def _write_jacobian_of_acceleration(ekf, axis, H):
    """Write the derivative of -g R₂ᵢ by the quaternion into its places in `H` (24,)."""
    R = ekf.R_to_earth
    H[ATTITUDE], H[ATTITUDE + 1], H[ATTITUDE + 2] = -ONE_G * R[1, axis], ONE_G * R[0, axis], 0.0
    complete_attitude_jacobian(ekf, H, -2.0 * ONE_G * R[2, axis])


@kernel
def _fuse_by_kept_gains(ekf, params):
    """Fuse one axis after the other, with gains that are all of before the first; return whether all were."""
    aid, core, H, K = ekf.aid.gravity, ekf.quaternion, ekf.scratch.H, ekf.scratch.K
    clear_jacobian(H)
    for axis in range(3):
        _write_jacobian_of_acceleration(ekf, axis, H)
        compute_kalman_gain(ekf, H, aid.innovation_variance[axis])
        for i in range(ERROR_STATE_SIZE):
            core.gains[axis, i] = K[i]
    for axis in range(3):
        for i in range(ERROR_STATE_SIZE):
            K[i] = core.gains[axis, i]
        core.innovation_variance = aid.innovation_variance[axis]
        if not measurement_update(ekf, params, aid.observation_variance[axis], aid.innovation[axis]):
            return False
    return True


@kernel
def _fuse_no_gravity(ekf, params):
    """v1.13 does not know it."""


control_gravity_fusion = by_release(
    by_release(_control_gravity_fusion, "levels_by_steady_gravity", _control_steady_gravity),
    "observes_acceleration_of_gravity",
    by_release(_control_acceleration_of_gravity, "fuses_no_gravity", _fuse_no_gravity),
)
