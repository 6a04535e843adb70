"""An estimator and parameters to set up by hand, for tests of single aid sources."""

from __future__ import annotations

from typing import Any

import numpy as np

from fusetune.ekf2.filter.common.parameters import parameter_record
from fusetune.ekf2.filter.estimator import EKF, initialise_estimator
from fusetune.px4.parameters.complete_sets import complete


def make_parameters(**overrides: float) -> np.void:
    """Parameters at their defaults but for the given ones."""
    return parameter_record(complete({}, overrides))[0]


def make_estimator(time_s: float = 100.0) -> np.void:
    """A level estimator at `time_s`, aimed north, all heights 0, of unit covariance; nothing is aligned or fused."""
    ekf = np.zeros(1, EKF)[0]
    initialise_estimator(ekf, make_parameters())
    ekf["P"][...] = np.eye(24)
    ekf["terrain"] = 0.0
    ekf["cs"]["in_air"] = False
    ekf["cs_prev"]["in_air"] = False
    ekf["buffers"]["observation_length"] = 20
    ekf["buffers"]["imu_length"] = 20
    at_time(ekf, time_s)
    return ekf


def at_time(ekf: np.void, time_s: float) -> None:
    """Move the fusion time horizon; the newest IMU sample is 0.2 s ahead of it."""
    ekf["time_delayed_us"] = round(time_s * 1e6)
    ekf["time_latest_us"] = round(time_s * 1e6) + 200_000


def put_sample(ekf: np.void, sensor: str, age_us: int, **values: Any) -> None:
    """Let a sample be due, measured so long before the fusion time horizon, and the newest one just in."""
    record = ekf["sensors"][sensor]
    record["sample"]["time_us"] = ekf["time_delayed_us"] - age_us
    for name, value in values.items():
        record["sample"][name] = value
    record["data_ready"] = True
    record["newest_time_us"] = ekf["time_latest_us"]


def is_running_after(ekf: np.void, params: np.void, silence_s: float, sensor: str, control: Any, flag: str) -> bool:
    """Whether a source still counts as fused so long after its sensor's newest sample."""
    ekf["sensors"][sensor]["data_ready"] = False
    ekf["time_latest_us"] = ekf["sensors"][sensor]["newest_time_us"] + round(silence_s * 1e6)
    control(ekf, params)
    return bool(ekf["cs"][flag])


def set_attitude(ekf: np.void, roll: float, pitch: float, yaw: float) -> None:
    """Set the attitude (rad, 3-2-1 sequence): quaternion and matrix from products of the elementary rotations."""
    q = np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])
    for half, axis in ((pitch / 2, 2), (roll / 2, 1)):
        step = np.zeros(4)
        step[0], step[axis] = np.cos(half), np.sin(half)
        q = hamilton_product(q, step)
    set_quaternion(ekf, q)


def set_quaternion(ekf: np.void, q: np.ndarray) -> None:
    """Set the attitude to the unit quaternion `q` (w, x, y, z)."""
    ekf["q"][:] = q
    ekf["R_to_earth"][...] = rotation_matrix(q)


def hamilton_product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a ⊗ b."""
    w = a[0] * b[0] - a[1:] @ b[1:]
    return np.concatenate([[w], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])])


def rotation_matrix(q: np.ndarray) -> np.ndarray:
    """Matrix of q ⊗ v ⊗ q*, by Rodrigues' formula."""
    x = np.array([[0, -q[3], q[2]], [q[3], 0, -q[1]], [-q[2], q[1], 0]])
    return np.eye(3) + 2 * q[0] * x + 2 * x @ x


def rotated_by_error(q: np.ndarray, error: np.ndarray) -> np.ndarray:
    """dq(error) ⊗ q: the attitude with an error vector given in the NED frame."""
    angle = np.linalg.norm(error)
    if angle == 0.0:
        return q
    return hamilton_product(np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * error / angle]), q)
