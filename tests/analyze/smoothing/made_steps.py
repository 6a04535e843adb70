"""A made flight of an IMU: truth, and a replay of it that starts wrong, has wrong biases and is corrected at will."""

from dataclasses import dataclass

import numpy as np

from fusetune.analyze.replaying.replayed_set import ReplayedSteps
from fusetune.ekf2.numerics.constants import ONE_G
from fusetune.quaternions import from_rotation_vector, multiply, rotation_matrix

STEP_US = 10_000
DT = STEP_US * 1e-6


@dataclass(frozen=True)
class MadeMotion:
    """True course after each step; `time` (N,) µs, `quaternion` (N, 4), `velocity` (N, 3), and what the IMU says."""

    time: np.ndarray
    quaternion: np.ndarray
    velocity: np.ndarray
    delta_angle: np.ndarray
    delta_velocity: np.ndarray


def motion(seconds: float, gyro_bias: np.ndarray, accel_bias: np.ndarray, start_us: int = 1_000_000) -> MadeMotion:
    """A vehicle that rolls, pitches, turns and accelerates; the IMU adds constant biases."""
    count = round(seconds / DT) + 1
    t = np.arange(count) * DT
    rate = np.column_stack([0.3 * np.sin(0.9 * t), 0.25 * np.cos(0.7 * t), 0.2 * np.sin(0.3 * t)])
    acceleration = np.column_stack([2.0 * np.sin(0.5 * t), 1.5 * np.cos(0.4 * t), 0.7 * np.sin(0.8 * t)])
    quaternion = [np.array([1.0, 0.0, 0.0, 0.0])]
    velocity = [np.zeros(3)]
    delta_angle, delta_velocity = [np.zeros(3)], [np.zeros(3)]
    for k in range(1, count):
        quaternion.append(multiply(quaternion[-1], from_rotation_vector(rate[k] * DT)))
        velocity.append(velocity[-1] + acceleration[k] * DT)
        force = rotation_matrix(quaternion[-1]).T @ (acceleration[k] - [0.0, 0.0, ONE_G])
        delta_angle.append((rate[k] + gyro_bias) * DT)
        delta_velocity.append((force + accel_bias) * DT)
    time = start_us + np.arange(count) * STEP_US
    return MadeMotion(time, *map(np.array, (quaternion, velocity, delta_angle, delta_velocity)))


def replayed(
    made: MadeMotion, rotation: np.ndarray, velocity: np.ndarray, corrections: np.random.Generator | None = None
) -> ReplayedSteps:
    """A filter that starts with errors (estimate less truth), knows no bias, and is corrected at every tenth step."""
    count = made.time.size
    q = [multiply(from_rotation_vector(rotation), made.quaternion[0])]
    v, gyro, accel = [made.velocity[0] + velocity], [np.zeros(3)], [np.zeros(3)]
    for k in range(1, count):
        turned = multiply(q[-1], from_rotation_vector(made.delta_angle[k] - gyro[-1] * DT))
        force = rotation_matrix(turned) @ (made.delta_velocity[k] - accel[-1] * DT)
        moved = v[-1] + force + np.array([0.0, 0.0, ONE_G]) * DT
        gyro.append(gyro[-1])
        accel.append(accel[-1])
        if corrections is not None and k % 10 == 0:
            turned = multiply(from_rotation_vector(2e-4 * corrections.normal(size=3)), turned)
            moved = moved + 0.05 * corrections.normal(size=3)
            gyro[-1] = gyro[-1] + 1e-5 * corrections.normal(size=3)
            accel[-1] = accel[-1] + 3e-3 * corrections.normal(size=3)
        q.append(turned)
        v.append(moved)
    dt = np.full(count, DT)
    return ReplayedSteps(
        made.time, np.array(q), np.array(v), np.array(gyro), np.array(accel),
        made.delta_angle, dt, made.delta_velocity, dt,
    )  # fmt: skip
