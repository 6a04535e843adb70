"""Random processes of sensors and weather, and the independent streams of random numbers they draw from."""

from __future__ import annotations

import math
import zlib

import numpy as np
from scipy.signal import lfilter


def random_stream(seed: int, name: str) -> np.random.Generator:
    """Generator of one named source of chance.

    Each source has its own stream, so that switching on a fault or changing one sensor leaves the noise of all others
    as it was.
    """
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, zlib.crc32(name.encode())])))


def gauss_markov(
    rng: np.random.Generator, samples: int, axes: int, step_s: float, deviation: float, correlation_time_s: float
) -> np.ndarray:
    """First-order Gauss–Markov process, (samples, axes), stationary from the first sample.

    Its autocorrelation is ``deviation² exp(-|τ| / correlation_time_s)``.
    """
    decay = math.exp(-step_s / correlation_time_s)
    draws = rng.standard_normal((samples, axes)) * deviation
    draws[1:] *= math.sqrt(1.0 - decay**2)
    return np.asarray(lfilter([1.0], [1.0, -decay], draws, axis=0))


def random_walk(rng: np.random.Generator, samples: int, axes: int, step_s: float, density: float) -> np.ndarray:
    """Random walk that starts at 0, (samples, axes); its standard deviation grows as ``density √t``."""
    steps = rng.standard_normal((samples, axes)) * (density * math.sqrt(step_s))
    steps[0] = 0.0
    return np.cumsum(steps, axis=0)


def white_noise(rng: np.random.Generator, samples: int, axes: int, step_s: float, density: float) -> np.ndarray:
    """White noise of a spectral density (unit/√Hz) sampled at a step, (samples, axes)."""
    return rng.standard_normal((samples, axes)) * (density / math.sqrt(step_s))


def unit_vectors(rng: np.random.Generator, count: int) -> np.ndarray:
    """Directions drawn evenly over the sphere, (count, 3)."""
    vectors = rng.standard_normal((count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
