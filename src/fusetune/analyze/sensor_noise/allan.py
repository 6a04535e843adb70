"""Overlapping Allan deviation of evenly sampled stretches, with the degrees of freedom of each value.

The Allan variance at τ = m Δt is half the mean square of the difference between two successive means over τ;
overlapping, it takes every start. Of several stretches (axes, times, flights) it is the mean over all terms: the mean
of each stretch drops out of it, so they need not agree. Formulas: IEEE Std 952-1997, annex C; NIST SP 1065 (Riley,
*Handbook of frequency stability analysis*), section 5.2.4 and table 5.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
NoiseKind = Literal["white", "flicker", "walk"]
KINDS: tuple[NoiseKind, ...] = ("white", "flicker", "walk")

FEWEST_MEANS = 4
"""So many means over τ that do not overlap; over fewer a deviation says next to nothing."""
SAME_STEP = 0.02
"""Sampling intervals that differ by less count as one: logs of one vehicle differ by the drift of its clock."""


@dataclass(frozen=True)
class AllanCurve:
    """Overlapping Allan variance at octaves of the sampling interval.

    Attributes
    ----------
    step_s : sampling interval, s
    factors : (T,) int, m of each value
    variance : (T,), unit² of the series
    terms : (T,) differences behind each value, overlapping ones too
    lengths : samples of each stretch that is in it
    """

    step_s: float
    factors: npt.NDArray[np.int64]
    variance: Array
    terms: Array
    lengths: tuple[int, ...]

    @property
    def tau_s(self) -> Array:
        """(T,) averaging times, s."""
        return np.asarray(self.factors * self.step_s, np.float64)

    @property
    def deviation(self) -> Array:
        """(T,) Allan deviation, unit of the series."""
        return np.sqrt(self.variance)

    @property
    def longest_s(self) -> float:
        """Length of the longest stretch, s."""
        return max(self.lengths, default=0) * self.step_s

    @property
    def total_s(self) -> float:
        """Length of all stretches together, s; of three axes three times."""
        return sum(self.lengths) * self.step_s

    @cached_property
    def freedom(self) -> dict[NoiseKind, Array]:
        """(T,) equivalent degrees of freedom for each kind of noise that may rule a value."""
        total: dict[NoiseKind, Array] = {}
        for kind in KINDS:
            total[kind] = np.zeros(len(self.factors))
            for length in self.lengths:
                used = FEWEST_MEANS * self.factors <= length
                total[kind][used] += degrees_of_freedom(kind, length, self.factors[used])
        return total

    def document(self) -> dict[str, Any]:
        """As a JSON object."""
        arrays = {name: getattr(self, name).tolist() for name in ("factors", "variance", "terms")}
        return {"step_s": self.step_s, **arrays, "lengths": list(self.lengths)}

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> AllanCurve:
        """Read what `document` made."""
        factors, variance, terms = (np.asarray(document[name]) for name in ("factors", "variance", "terms"))
        return cls(
            float(document["step_s"]),
            factors.astype(np.int64),
            variance.astype(np.float64),
            terms.astype(np.float64),
            tuple(document["lengths"]),
        )


def allan_curve(stretches: Sequence[npt.ArrayLike], step_s: float) -> AllanCurve:
    """Allan variance of stretches of one sampling interval.

    Parameters
    ----------
    stretches : each (N,) or (N, axes), finite; axes count as stretches of their own
    step_s : sampling interval, s
    """
    longest = max((len(np.asarray(one)) for one in stretches), default=0)
    octaves = int(np.log2(longest // FEWEST_MEANS)) + 1 if longest >= FEWEST_MEANS else 0
    factors = 2 ** np.arange(octaves, dtype=np.int64)
    sums, terms, lengths = np.zeros(octaves), np.zeros(octaves), []
    for one in stretches:
        values = np.asarray(one, np.float64)
        values = values.reshape(len(values), -1)
        lengths += [len(values)] * values.shape[1]
        # without the mean the running sum stays small, and so do the roundings in its differences
        summed = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values - values.mean(axis=0), axis=0)])
        for row, m in enumerate(factors):
            if FEWEST_MEANS * m > len(values):
                break
            second = summed[2 * m :] - 2.0 * summed[m:-m] + summed[: -2 * m]
            sums[row] += float(np.einsum("ij,ij->", second, second)) / (2.0 * float(m) ** 2)
            terms[row] += second.size
    return AllanCurve(step_s, factors, sums / np.maximum(terms, 1.0), terms, tuple(lengths))


def pooled_curve(curves: Iterable[AllanCurve]) -> AllanCurve | None:
    """One curve of several: each value is the mean over the terms of all; None of none.

    Curves of another sampling interval than the one with most samples are left out: their octaves lie elsewhere.
    """
    found = [one for one in curves if len(one.factors)]
    if not found:
        return None
    first = max(found, key=lambda one: sum(one.lengths))
    same = [one for one in found if abs(one.step_s / first.step_s - 1.0) < SAME_STEP]
    octaves = max(len(one.factors) for one in same)
    sums, terms = np.zeros(octaves), np.zeros(octaves)
    for one in same:
        sums[: len(one.factors)] += one.variance * one.terms
        terms[: len(one.factors)] += one.terms
    factors = 2 ** np.arange(octaves, dtype=np.int64)
    lengths = tuple(length for one in same for length in one.lengths)
    return AllanCurve(first.step_s, factors, sums / np.maximum(terms, 1.0), terms, lengths)


def degrees_of_freedom(kind: NoiseKind, samples: int, factors: npt.NDArray[np.int64]) -> Array:
    """Equivalent degrees of freedom of an overlapping Allan variance, (T,), not below 1 (NIST SP 1065, table 5).

    Parameters
    ----------
    kind : noise that rules at this τ: white, flicker (1/f) or random walk of the sensor's output
    samples : N; the formulas count the N + 1 values of its running sum
    factors : (T,) m
    """
    m = np.asarray(factors, np.float64)
    return np.maximum(_FREEDOM[kind](samples + 1.0, m), 1.0)


def _freedom_of_white(n: float, m: Array) -> Array:
    return np.asarray((1.5 * (n - 1.0) / m - 2.0 * (n - 2.0) / n) * 4.0 * m**2 / (4.0 * m**2 + 5.0))


def _freedom_of_flicker(n: float, m: Array) -> Array:
    return np.where(m == 1.0, 2.0 * (n - 2.0) ** 2 / (2.3 * n - 4.9), 5.0 * n**2 / (4.0 * m * (n + 3.0 * m)))


def _freedom_of_walk(n: float, m: Array) -> Array:
    return np.asarray((n - 2.0) / m * ((n - 1.0) ** 2 - 3.0 * m * (n - 1.0) + 4.0 * m**2) / (n - 3.0) ** 2)


_FREEDOM = {"white": _freedom_of_white, "flicker": _freedom_of_flicker, "walk": _freedom_of_walk}
