"""Noise density, bias instability and rate random walk from an Allan curve, each with its interval or a refusal.

White noise of density N, flicker of bias instability B and a random walk of density K add up to

    σ²(τ) = N² / τ + (2 ln 2 / π) B² + K² τ / 3

(`allan_model`). The three are fitted to the whole curve by generalised least squares, none of them negative: reading
them off where the slope is −1/2, 0 and +1/2 takes for one what the neighbours add, and needs a record long enough for
each slope to stand alone. The values of a curve scatter by their equivalent degrees of freedom and are correlated, for
they are made of the same samples: with S the spectral density of the fitted noise and H the Allan filter,
cov ∝ ∫ S² Hₐ H_b df.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls

from fusetune.analyze.metrics.consistency import chi2_quantile
from fusetune.analyze.sensor_noise.allan import FEWEST_MEANS, KINDS, AllanCurve, NoiseKind, degrees_of_freedom
from fusetune.analyze.sensor_noise.allan_model import FLICKER, NoiseModel

Array = npt.NDArray[np.float64]

NAMES: Mapping[NoiseKind, str] = {
    "white": "noise density",
    "flicker": "bias instability",
    "walk": "rate random walk",
}
CONFIDENCE = 0.95
NORMAL = 1.96
"""Standard deviations to either side that hold 95 % of a normal variable."""
DISTINCT = 3.0
"""A part of the curve is told when it stands so many of its standard deviations above nothing."""
FEWEST_VALUES = 5
"""Octaves that a fit of three parts needs."""
_ITERATIONS = 6
_MOST_LEFT_OUT = 5
"""Octaves at the short end that may follow the sensor's own low-pass filter and not the noise."""
_MISFIT = 2.5
"""χ² per degree of freedom from which the short end is suspected."""
FEWEST_FOR_CORRELATION_TIME = 10
"""Octaves over which flicker noise and one correlation time look different."""
SUSPECT = 1.5
"""χ² per degree of freedom from which other correlations of the bias are tried …"""
CLEARLY = 9.0
"""… of which one is taken when it lessens χ² by so much: three standard deviations, for one more parameter."""
_FINER = (1.0 / 3.0, 1.0 / 6.0, 1.0 / 12.0)
"""Octaves to either side that are tried after each round."""
_FREQUENCIES = 1000
USUAL_TAU_S: Mapping[NoiseKind, float] = {"white": 0.5, "flicker": 60.0, "walk": 300.0}
"""Where MEMS sensors as on autopilots usually show each part (about a second; the bottom at a minute, the rise after
five): Allan curves in the data sheets of ICM-42688-P, BMI088 and ADIS16470, rounded."""


@dataclass(frozen=True)
class NoiseFigure:
    """One of the three figures.

    Attributes
    ----------
    value : None where the record does not tell it
    low, high : 95 % interval; where there is no value `low` is 0 and `high` what it is not above
    freedom : equivalent degrees of freedom behind it
    refusal : why there is no value, in words
    """

    value: float | None
    low: float
    high: float | None
    freedom: float
    refusal: str = ""

    def document(self) -> dict[str, Any]:
        """As a JSON object."""
        return dict(vars(self))


@dataclass(frozen=True)
class AllanFigures:
    """What an Allan curve says of a sensor of unit u.

    Attributes
    ----------
    noise_density : N, u/√Hz
    bias_instability : B, u (the flat part of the curve lies at 0.664 B)
    random_walk : K, u/√s (= u √Hz)
    from_s : shortest τ that was fitted, s
    misfit : χ² per degree of freedom of the fit; the intervals are widened by its root where it is above 1
    model : how the bias wanders: as flicker noise, or with one correlation time where a long record says so
    """

    noise_density: NoiseFigure
    bias_instability: NoiseFigure
    random_walk: NoiseFigure
    from_s: float
    misfit: float
    model: NoiseModel = FLICKER

    def of(self, kind: NoiseKind) -> NoiseFigure:
        """The figure of one kind of noise."""
        return {"white": self.noise_density, "flicker": self.bias_instability, "walk": self.random_walk}[kind]

    def deviation(self, tau_s: Array) -> Array:
        """The fitted deviation at averaging times (T,), s, of the parts that have a value."""
        parts = [self.of(kind).value or 0.0 for kind in KINDS]
        return np.asarray(np.sqrt(self.model.variances(tau_s) @ np.square(parts)))

    def document(self) -> dict[str, Any]:
        """As a JSON object."""
        parts = ("noise_density", "bias_instability", "random_walk")
        figures = {name: getattr(self, name).document() for name in parts}
        correlation_s = self.model.correlation_s
        return {**figures, "from_s": self.from_s, "misfit": self.misfit, "correlation_time_s": correlation_s}


def allan_figures(curve: AllanCurve) -> AllanFigures:
    """Fit the three parts to a curve.

    Where the curve bends at its short end, as a sensor's own low-pass filter makes it, up to five octaves are left
    out.
    """
    usable = np.flatnonzero(curve.variance > 0.0)
    if len(usable) < FEWEST_VALUES:
        return _refused(curve)
    best = _with_correlation_time(curve, _fit(curve, usable, FLICKER))
    for left_out in range(1, _MOST_LEFT_OUT + 1):
        if best.misfit < _MISFIT or len(usable) - left_out < FEWEST_VALUES:
            break
        other = _with_correlation_time(curve, _fit(curve, usable[left_out:], FLICKER))
        best = other if other.misfit < best.misfit else best
    scale = max(best.misfit, 1.0)
    told = {
        kind: _figure(curve, kind, float(part), float(variance) * scale)
        for kind, part, variance in zip(KINDS, best.parts, best.variances, strict=True)
    }
    return AllanFigures(told["white"], told["flicker"], told["walk"], best.from_s, best.misfit, best.model)


def _with_correlation_time(curve: AllanCurve, best: _Fit) -> _Fit:
    """The fit with the correlation time that fits best, where flicker noise fits a long record clearly worse."""
    if len(best.rows) < FEWEST_FOR_CORRELATION_TIME or best.misfit < SUSPECT:
        return best
    flicker, tried = best, curve.tau_s[best.rows][2:-2]
    for finer in _FINER:
        for correlation_s in tried:
            other = _fit(curve, best.rows, NoiseModel(float(correlation_s)))
            best = other if other.chi2 < min(best.chi2, flicker.chi2 - CLEARLY) else best
        if best.model.correlation_s is None:
            return flicker
        tried = best.model.correlation_s * 2.0 ** np.array([-finer, finer])
    return best


def interval(deviation: Array, freedom: Array) -> tuple[Array, Array]:
    """95 % interval of deviations with their degrees of freedom: σ² f / χ² (NIST SP 1065, section 5.3)."""
    low, high = (0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE))
    return (
        np.asarray(deviation * np.sqrt(freedom / chi2_quantile(high, freedom))),
        np.asarray(deviation * np.sqrt(freedom / chi2_quantile(low, freedom))),
    )


def freedom_of_mixture(curve: AllanCurve, figures: AllanFigures) -> Array:
    """(T,) degrees of freedom, those of the kinds of noise by their share at each τ."""
    parts = np.array([(figures.of(kind).value or 0.0) ** 2 for kind in KINDS])
    return _mixed_freedom(curve, np.arange(len(curve.factors)), figures.model, parts)


@lru_cache(maxsize=16)
def needed_s(kind: NoiseKind, tau_s: float) -> float:
    """How long a record must be for the part that shows at τ: until its value has 2 · 3² degrees of freedom, s."""
    wanted = 2.0 * DISTINCT**2
    for ratio in range(FEWEST_VALUES, 200):
        # any m large enough shows the ratio N/m alone
        if degrees_of_freedom(kind, ratio * 64, np.array([64]))[0] >= wanted:
            return ratio * tau_s
    raise AssertionError("degrees of freedom grow with the length of the record")


@dataclass(frozen=True)
class _Fit:
    rows: npt.NDArray[np.int64]
    model: NoiseModel
    parts: Array
    variances: Array
    from_s: float
    chi2: float

    @property
    def misfit(self) -> float:
        """χ² per degree of freedom."""
        return self.chi2 / max(len(self.rows) - len(KINDS), 1)


def _fit(curve: AllanCurve, rows: npt.NDArray[np.int64], model: NoiseModel) -> _Fit:
    tau, measured = curve.tau_s[rows], curve.variance[rows]
    shapes = model.variances(tau)
    weights = np.sqrt(curve.freedom["white"][rows] / 2.0)
    parts = nnls(shapes / measured[:, None] * weights[:, None], weights)[0]
    whitened, target = shapes, measured
    for _ in range(_ITERATIONS):
        expected = shapes @ parts
        deviation = expected * np.sqrt(2.0 / _mixed_freedom(curve, rows, model, parts))
        correlation = _correlation(tuple(curve.factors[rows].tolist()), curve.step_s, model, parts)
        # numpy's own small inverse: the triangular solver of BLAS waits for its threads longer than it works
        whitening = np.linalg.inv(np.linalg.cholesky(correlation + 1e-6 * np.eye(len(rows))))
        whitened = whitening @ (shapes / deviation[:, None])
        target = whitening @ (measured / deviation)
        before, parts = parts, _positive(whitened, target)
        if np.allclose(before, parts, rtol=1e-3, atol=0.0):
            break
    residual = target - whitened @ parts
    size = np.linalg.norm(whitened, axis=0)
    covariance = np.linalg.inv(whitened.T @ whitened / np.outer(size, size)) / np.outer(size, size)
    return _Fit(rows, model, parts, np.diag(covariance), float(tau[0]), float(residual @ residual))


def _positive(matrix: Array, target: Array) -> Array:
    """Least squares without negative parts; columns are scaled, for N² and K² may differ by a factor of 10¹²."""
    size = np.linalg.norm(matrix, axis=0)
    return np.asarray(nnls(matrix / size, target)[0] / size)


def _mixed_freedom(curve: AllanCurve, rows: npt.NDArray[np.int64], model: NoiseModel, parts: Array) -> Array:
    shares = model.variances(curve.tau_s[rows]) * parts
    total = shares.sum(axis=1)
    shares = np.where(total[:, None] > 0.0, shares / np.where(total > 0.0, total, 1.0)[:, None], [1.0, 0.0, 0.0])
    kinds = np.column_stack([curve.freedom[kind][rows] for kind in KINDS])
    return np.maximum((shares * kinds).sum(axis=1), 1.0)


def _correlation(factors: tuple[int, ...], step_s: float, model: NoiseModel, parts: Array) -> Array:
    """Of the values of a curve among each other, (T, T), under the fitted noise."""
    frequency, width, filters = _allan_filters(factors)
    density = model.density(frequency / step_s, parts)
    weighted = filters * (density / density.max() * np.sqrt(width))
    # not by BLAS, whose threads wait for each other longer than this takes
    product = np.einsum("if,jf->ij", weighted, weighted)
    size = np.sqrt(np.diag(product))
    return np.asarray(product / np.outer(size, size))


@lru_cache(maxsize=64)
def _allan_filters(factors: tuple[int, ...]) -> tuple[Array, Array, Array]:
    """Frequencies (F,), cycles per sample, their widths, and |H|² of each m, (T, F): 2 sin⁴(π f m) / (m sin π f)².

    Evenly spaced by logarithm: where sin⁴ turns over many times between two of them, they sample it as chance would.
    """
    edges = np.geomspace(0.02 / factors[-1], 0.5, _FREQUENCIES + 1)
    frequency = np.sqrt(edges[1:] * edges[:-1])
    m = np.array(factors, np.float64)[:, None]
    filters = 2.0 * np.sin(math.pi * frequency * m) ** 4 / (m * np.sin(math.pi * frequency)) ** 2
    return frequency, np.diff(edges), filters


def _figure(curve: AllanCurve, kind: NoiseKind, part: float, variance: float) -> NoiseFigure:
    """Value and interval of one part from its fitted square and the variance of that.

    The square is spread like χ² where it makes most of the curve's scatter itself, and like a normal variable where the
    rest of the noise does: the wider of the two on either side holds in both cases and in between.
    """
    deviation = math.sqrt(variance)
    freedom = 2.0 * part**2 / variance if variance > 0.0 else 0.0
    if part > 0.0 and part >= DISTINCT * deviation:
        low, high = interval(np.sqrt([part]), np.array([freedom]))
        below, above = part - NORMAL * deviation, part + NORMAL * deviation
        return NoiseFigure(
            math.sqrt(part), min(float(low[0]), math.sqrt(below)), max(float(high[0]), math.sqrt(above)), freedom
        )
    above = part + NORMAL * deviation
    if freedom > 1.0:
        above = max(above, part * freedom / float(chi2_quantile(0.5 * (1.0 - CONFIDENCE), freedom)))
    return NoiseFigure(None, 0.0, math.sqrt(above), freedom, _refusal(curve, kind))


def _refusal(curve: AllanCurve, kind: NoiseKind) -> str:
    needs = needed_s(kind, USUAL_TAU_S[kind])
    if curve.longest_s < needs:
        return _too_short(curve, kind, needs)
    return f"in {curve.longest_s:.0f} s of standing still the {NAMES[kind]} does not rise above the rest of the noise"


def _too_short(curve: AllanCurve, kind: NoiseKind, needs_s: float) -> str:
    return f"the log stands still for only {curve.longest_s:.0f} s: the {NAMES[kind]} needs about {needs_s:.0f} s"


def _refused(curve: AllanCurve) -> AllanFigures:
    fewest_s = FEWEST_MEANS * 2 ** (FEWEST_VALUES - 1) * curve.step_s
    white, flicker, walk = (
        NoiseFigure(None, 0.0, None, 0.0, _too_short(curve, kind, max(fewest_s, needed_s(kind, USUAL_TAU_S[kind]))))
        for kind in KINDS
    )
    return AllanFigures(white, flicker, walk, curve.step_s, 0.0)
