"""Functions of time with their first two derivatives: arrays (3, N) of value, slope and curvature."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Jet = npt.NDArray[np.float64]


def sinusoid(time: npt.NDArray[np.float64], amplitude: float, rate: float, phase: float) -> Jet:
    """`amplitude sin(rate t + phase)`, rate in rad/s."""
    angle = rate * time + phase
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.array([amplitude * sine, amplitude * rate * cosine, -amplitude * rate**2 * sine])


def ramp(time: npt.NDArray[np.float64], start: float, stop: float) -> Jet:
    """From 0 at `start` to 1 at `stop` with three vanishing derivatives at both ends: x⁴ (35 − 84x + 70x² − 20x³)."""
    length = stop - start
    x = np.clip((time - start) / length, 0.0, 1.0)
    value = x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3)
    slope = 140.0 * (x * (1.0 - x)) ** 3 / length
    curvature = 420.0 * (x * (1.0 - x)) ** 2 * (1.0 - 2.0 * x) / length**2
    return np.array([value, slope, curvature])


def product(one: Jet, other: Jet) -> Jet:
    """Leibniz' rule."""
    return np.array(
        [
            one[0] * other[0],
            one[1] * other[0] + one[0] * other[1],
            one[2] * other[0] + 2.0 * one[1] * other[1] + one[0] * other[2],
        ]
    )
