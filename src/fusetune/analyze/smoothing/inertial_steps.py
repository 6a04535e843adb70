"""The inertial solution of a replay: what the IMU alone did to its state between updates, and what was corrected.

With δ = truth − estimate, to first order and in NED, over one update with the rotated specific force F = R Δv̂ (the
velocity that the accelerometer adds), the errors g_g, g_a of the biases, and the correction Δ that fusion made:

    δθ ← δθ − R g_g dt            then  − Δθ
    δv ← δv + δθ × F − R g_a dt   then  − Δv

Sums of these steps say how errors at one update follow from those at any other, with all corrections taken out, so that
it does not matter which sources a parameter set fused and how much it trusted them: the replay is only where the errors
are linearised. (Signs as in `fusetune.ekf2.filter.prediction`, where δ has the other sign of the biases' part alike.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.replaying.replayed_set import ReplayedSteps
from fusetune.ekf2.numerics.constants import ONE_G
from fusetune.quaternions import conjugate, from_rotation_vector, multiply, rotation_matrix, rotation_vector

Array = npt.NDArray[np.float64]

_AT_ONCE = 1 << 14
"""Updates whose matrices are made at a time: of an hour all of them would be tens of megabytes each."""


@dataclass(frozen=True)
class InertialSteps:
    """Running sums over the updates 0 … K − 1 of a stretch.

    Attributes
    ----------
    time : (K,) µs
    velocity : (K, 3) estimate after each update, NED, m/s
    acceleration : (K, 3) that the velocity was predicted with, NED, m/s²
    force : (K, 3) ΣF, m/s
    turned : (K, 3, 3) A = Σ R dt, s
    turned_force : (K, 3, 3) Σ [F]× A, m/s · s
    known_rotation : (K, 3) K = part of δθ that follows from the corrections and the changes of the biases, rad
    known_velocity : (K, 3) the same of δv, with Σ K × F, m/s
    force_time, known_velocity_time : (K, 3) integrals of `force` and `known_velocity` (trapezoids), m
    """

    time: npt.NDArray[np.int64]
    velocity: Array
    acceleration: Array
    force: Array
    turned: Array
    turned_force: Array
    known_rotation: Array
    known_velocity: Array
    force_time: Array
    known_velocity_time: Array


def inertial_steps(steps: ReplayedSteps) -> InertialSteps:
    """Sums over the steps of a stretch; its first update is where they begin."""
    before = slice(None, -1)
    rotation = steps.delta_angle[1:] - steps.gyro_bias[before] * steps.delta_angle_dt[1:, None]
    predicted = multiply(steps.quaternion[before], from_rotation_vector(rotation))
    turn = rotation_matrix(predicted)
    dt, dv_dt = steps.delta_angle_dt[1:, None], steps.delta_velocity_dt[1:, None]
    force = _turned(turn, steps.delta_velocity[1:] - steps.accel_bias[before] * dv_dt)
    gained = force + np.array([0.0, 0.0, ONE_G]) * dv_dt

    corrected_rotation = rotation_vector(multiply(steps.quaternion[1:], conjugate(predicted)))
    corrected_velocity = steps.velocity[1:] - (steps.velocity[before] + gained)
    # of an hour each of these is tens of megabytes, so none stays longer than it is needed
    del predicted, rotation
    by_bias = _turned(turn, steps.gyro_bias[before] - steps.gyro_bias[0]) * dt
    known_rotation = np.cumsum(by_bias - corrected_rotation, axis=0)
    # the correction comes after the velocity was predicted
    known_force = np.cross(known_rotation + corrected_rotation, force)
    del by_bias, corrected_rotation
    by_bias = _turned(turn, steps.accel_bias[before] - steps.accel_bias[0]) * dv_dt
    known_velocity = _summed(known_force + by_bias - corrected_velocity)
    del by_bias, known_force, corrected_velocity
    turn *= dt[:, :, None]
    turned = _summed(turn)
    del turn
    force_sum = _summed(force)
    return InertialSteps(
        time=steps.time,
        velocity=steps.velocity,
        acceleration=_from_zero(gained / dv_dt),
        force=force_sum,
        turned=turned,
        turned_force=_turned_force(force, turned),
        known_rotation=_from_zero(known_rotation),
        known_velocity=known_velocity,
        force_time=_integrated(force_sum, steps.time),
        known_velocity_time=_integrated(known_velocity, steps.time),
    )


@dataclass(frozen=True)
class Transitions:
    """How errors (δv, δθ) at one update follow from those at an earlier one, for M pairs of updates.

    δv' = δv + `velocity_by_rotation` δθ + `velocity_by_gyro` g_g − `turned` g_a + `known_velocity`
    δθ' = δθ − `turned` g_g + `known_rotation`

    and by how much the error of the integrated velocity grew (of the constants, as if evenly): δv T +
    `position_by_rotation` δθ + ½ T (`velocity_by_gyro` g_g − `turned` g_a) + `known_position`.
    """

    passed_s: Array
    velocity_by_rotation: Array
    velocity_by_gyro: Array
    turned: Array
    known_velocity: Array
    known_rotation: Array
    position_by_rotation: Array
    known_position: Array


def transitions(sums: InertialSteps, start: npt.NDArray[np.int64], stop: npt.NDArray[np.int64]) -> Transitions:
    """Between the updates `start` (M,) and `stop` (M,), which are positions in the stretch."""
    force = cross_matrix(sums.force[stop] - sums.force[start])
    turned_force = sums.turned_force[stop] - sums.turned_force[start] - force @ sums.turned[start]
    known = sums.known_velocity[stop] - sums.known_velocity[start] + _turned(force, sums.known_rotation[start])
    passed_s: Array = np.asarray((sums.time[stop] - sums.time[start]) * 1e-6, np.float64)
    force_time = cross_matrix(_less_first(sums.force_time, sums.force, start, stop, passed_s))
    known_time = _less_first(sums.known_velocity_time, sums.known_velocity, start, stop, passed_s)
    return Transitions(
        passed_s=passed_s,
        velocity_by_rotation=-force,
        velocity_by_gyro=turned_force,
        turned=sums.turned[stop] - sums.turned[start],
        known_velocity=known,
        known_rotation=sums.known_rotation[stop] - sums.known_rotation[start],
        position_by_rotation=-force_time,
        known_position=known_time + _turned(force_time, sums.known_rotation[start]),
    )


def _less_first(
    integral: Array, values: Array, start: npt.NDArray[np.int64], stop: npt.NDArray[np.int64], passed_s: Array
) -> Array:
    """Integral from `start` to `stop` of what values exceed that at `start` by."""
    return np.asarray(integral[stop] - integral[start] - passed_s[:, None] * values[start])


def cross_matrix(vector: Array) -> Array:
    """[v]× (…, 3, 3) of vectors (…, 3)."""
    x, y, z = np.moveaxis(vector, -1, 0)
    zero = np.zeros_like(x)
    return np.stack(
        [np.stack([zero, -z, y], axis=-1), np.stack([z, zero, -x], axis=-1), np.stack([-y, x, zero], axis=-1)], axis=-2
    )


def _turned(matrices: Array, vectors: Array) -> Array:
    return np.asarray(np.einsum("kij,kj->ki", matrices, vectors))


def _integrated(values: Array, time: npt.NDArray[np.int64]) -> Array:
    step_s = np.diff(time)[:, None] * 1e-6
    return _summed(0.5 * (values[1:] + values[:-1]) * step_s)


def _turned_force(force: Array, turned: Array) -> Array:
    """(K + 1, 3, 3) running sums of [F]× A, some updates at a time."""
    sums = np.zeros((len(force) + 1, 3, 3))
    for start in range(0, len(force), _AT_ONCE):
        some = slice(start, start + _AT_ONCE)
        np.matmul(cross_matrix(force[some]), turned[1:][some], out=sums[1:][some])
    np.cumsum(sums[1:], axis=0, out=sums[1:])
    return sums


def _summed(values: Array) -> Array:
    """(K + 1, …) running sums from 0 of values (K, …)."""
    sums = np.empty((len(values) + 1, *values.shape[1:]))
    sums[0] = 0.0
    np.cumsum(values, axis=0, out=sums[1:])
    return sums


def _from_zero(sums: Array) -> Array:
    return np.concatenate([np.zeros((1, *sums.shape[1:])), sums])
