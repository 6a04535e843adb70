"""Noise of a sensor as a sum of three: its Allan variance and its spectral density.

White noise of density N, a wandering bias of instability B and a random walk of density K:

    σ²(τ) = N² / τ + (2 ln 2 / π) B² + K² τ / 3,    S(f) = 2 N² + B² / (π f) + K² / (2 π² f²)

with the one-sided density S (IEEE Std 952-1997, annex C). The bias wanders as flicker noise does, flat over all τ, or
as a first-order Gauss–Markov process of one correlation time T, whose variance has its largest value near τ = 1.89 T;
that is where B is read then, so that B means the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

FLAT = 2.0 * math.log(2.0) / math.pi
"""σ² of flicker noise over B²."""
LARGEST_OF_GAUSS_MARKOV = 0.38114
"""Largest Allan variance of a Gauss–Markov process over the variance of its values, at τ = 1.893 T."""


@dataclass(frozen=True)
class NoiseModel:
    """How the bias wanders.

    Attributes
    ----------
    correlation_s : T of a Gauss–Markov process, s; None for flicker noise
    """

    correlation_s: float | None = None

    def variances(self, tau_s: Array) -> Array:
        """Allan variance of each of the three at unit N², B², K², (T, 3)."""
        flat = np.full_like(tau_s, FLAT) if self.correlation_s is None else self._gauss_markov(tau_s)
        return np.column_stack([1.0 / tau_s, flat, tau_s / 3.0])

    def density(self, frequency_hz: Array, parts: Array) -> Array:
        """One-sided spectral density at frequencies (F,) of squares N², B², K²."""
        white, bias, walk = parts
        f = frequency_hz
        if self.correlation_s is None:
            wandering = bias / (math.pi * f)
        else:
            t = self.correlation_s
            wandering = bias * FLAT / LARGEST_OF_GAUSS_MARKOV * 4.0 * t / (1.0 + (2.0 * math.pi * f * t) ** 2)
        return np.asarray(2.0 * white + wandering + walk / (2.0 * math.pi**2 * f**2))

    def _gauss_markov(self, tau_s: Array) -> Array:
        """Scaled to be `FLAT` where it is largest: 2σ²T/τ (1 − T/2τ (3 − 4 e^(−τ/T) + e^(−2τ/T)))."""
        ratio = tau_s / float(self.correlation_s or math.nan)
        # of very short τ the terms of the formula cancel to ratio / 3
        exact = 2.0 / ratio * (1.0 - (3.0 - 4.0 * np.exp(-ratio) + np.exp(-2.0 * ratio)) / (2.0 * ratio))
        return np.asarray(np.where(ratio < 1e-3, 2.0 * ratio / 3.0, exact) * FLAT / LARGEST_OF_GAUSS_MARKOV)


FLICKER = NoiseModel()
