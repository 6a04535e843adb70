"""Chance of one flight: a stream for each sensor, and Markov errors."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

Array = npt.NDArray[np.float64]

STREAMS = ("path", "accelerometer", "gyro", "gnss", "magnetometer", "barometer", "wind")


def streams(seed: int) -> dict[str, np.random.Generator]:
    """Independent generators by name."""
    parts = np.random.SeedSequence((seed, 0x5EC0D)).spawn(len(STREAMS))
    return {name: np.random.default_rng(part) for name, part in zip(STREAMS, parts, strict=True)}


def markov(rng: np.random.Generator, samples: int, axes: int, step_s: float, spread: float, time_s: float) -> Array:
    """First-order Markov process (samples, axes) of standard deviation `spread` and correlation time `time_s`."""
    keep = np.exp(-step_s / time_s)
    drive = rng.normal(0.0, spread, (samples, axes))
    drive[1:] *= np.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], drive, axis=0))


def resonance(
    rng: np.random.Generator, samples: int, axes: int, step_s: float, frequency_hz: float, damping: float
) -> Array:
    """Second-order autoregression (samples, axes) of standard deviation 1 with its pole at a damped frequency.

    Box and Jenkins, "Time Series Analysis", 1970, section 3.2.4: the variance of x_k = a x_(k-1) + b x_(k-2) + e_k is
    (1 - b) / ((1 + b) ((1 - b)² - a²)) times that of e.
    """
    angle = 2.0 * np.pi * frequency_hz * step_s
    radius = np.exp(-damping * angle)
    a, b = 2.0 * radius * np.cos(angle * np.sqrt(1.0 - damping**2)), -(radius**2)
    variance = (1.0 - b) / ((1.0 + b) * ((1.0 - b) ** 2 - a**2))
    return np.asarray(lfilter([1.0], [1.0, -a, -b], rng.standard_normal((samples, axes)), axis=0) / np.sqrt(variance))
