"""Where a sensor is that stands off the IMU, and how it moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusetune.execute.world.truth import Truth


def place_of(truth: Truth, at_us: np.ndarray, position_m: Sequence[float]) -> np.ndarray:
    """Place of a sensor at given times, tangent frame, (N, 3) m."""
    offset = truth.attitude_at(at_us).apply(np.asarray(position_m))
    return np.asarray(truth.at(at_us, truth.position) + offset)


def velocity_of(truth: Truth, at_us: np.ndarray, position_m: Sequence[float]) -> np.ndarray:
    """Its velocity, that of the IMU and of turning about it, tangent frame, (N, 3) m/s."""
    turning = np.cross(truth.body_rate_at(at_us), np.asarray(position_m))
    return np.asarray(truth.at(at_us, truth.velocity) + truth.attitude_at(at_us).apply(turning))


def distance_to_ground(
    truth: Truth, at_us: np.ndarray, position_m: Sequence[float], ground_distance_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Distance to the flat ground along the body's down axis, and the cosine of the tilt, each (N,).

    The ground lies `ground_distance_m` below the sensor of a vehicle that stands at home, level. The distance is
    infinite where the axis does not point down.
    """
    cos_tilt = truth.attitude_at(at_us).apply([0.0, 0.0, 1.0])[:, 2]
    height = position_m[2] + ground_distance_m - place_of(truth, at_us, position_m)[:, 2]
    with np.errstate(divide="ignore"):
        return np.where(cos_tilt > 0.0, np.maximum(height, 0.0) / np.maximum(cos_tilt, 1e-9), np.inf), cos_tilt
