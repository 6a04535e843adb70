"""Flights that answer at once: between sets that were really tried on them, scores are interpolated.

Hundreds of searches, each with its cross-fitting, are too dear to be replayed. Each flight's score is a smooth
function of the factors, and is emulated in each kind of prediction by a Gaussian process through the sets that were
tried; lengths and scale are those of the mean over the flights. Beyond the outermost of these sets the scores stay as
they are there.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

from fusetune.apply.evidence import AIMS
from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.requests import Ask, Values
from fusetune.design.factors import Factor

Array = npt.NDArray[np.float64]

_FAR = 2.0
"""Scores beyond so many nat say no more than that a set is bad."""
_NUGGET = 1e-8


@dataclass(frozen=True, eq=False)
class TriedTable:
    """N sets that were tried on F flights, the present set first, with no differences.

    Attributes
    ----------
    coordinates : (N, P) of the factors
    aims : (N, F) differences to the present set in each kind of prediction; 0 where a flight does not have it
    weights : of each kind in the score of each flight, (F,)
    objected : (N,) whether something else speaks against the set
    """

    factors: tuple[Factor, ...]
    coordinates: Array
    aims: Mapping[str, Array]
    weights: Mapping[str, Array]
    objected: npt.NDArray[np.bool_]


def tried_table(factors: Sequence[Factor], sets: Sequence[Mapping[str, float]], compared: Comparison) -> TriedTable:
    """A table of what was compared with the present set; sets that a flight has no score of are left out.

    The score of a flight is a weighted sum of its kinds of prediction; the weights follow from the differences.
    """
    known = np.asarray(np.isfinite(compared.differences).all(axis=1))
    rows = [[one.coordinate(values[one.parameter]) for one in factors] for values in sets]
    aims = {name: np.nan_to_num(compared.aims[name][known]) for name in AIMS}
    weights = np.array(
        [
            np.linalg.lstsq(np.column_stack([aims[name][:, at] for name in AIMS]), score, rcond=None)[0]
            for at, score in enumerate(compared.differences[known].T)
        ]
    )
    first = np.zeros((1, len(factors)))
    return TriedTable(
        tuple(factors),
        np.vstack([first, np.array(rows)[known]]),
        {name: np.vstack([np.zeros((1, one.shape[1])), one]) for name, one in aims.items()},
        dict(zip(AIMS, weights.T, strict=True)),
        np.r_[False, [bool(one) for one, use in zip(compared.objections, known, strict=True) if use]],
    )


class Emulator:
    """Differences to the present set at any point, on every flight of a table."""

    def __init__(self, table: TriedTable) -> None:
        self.table = table
        self._low, self._high = table.coordinates.min(axis=0), table.coordinates.max(axis=0)
        self._fits = {name: self._fit(values) for name, values in table.aims.items()}

    def _fit(self, values: Array) -> tuple[object, Array, Array]:
        """Kernel, weights (N, F), and offset (F,)."""
        clipped = np.clip(values, -_FAR, _FAR)
        kernel = ConstantKernel(5.0, (0.5, 1e4)) * Matern(
            np.full(self._low.size, 4.0), (1.0, 60.0), nu=2.5
        ) + WhiteKernel(1e-4, (1e-7, 0.1))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            process = GaussianProcessRegressor(kernel, alpha=1e-10, normalize_y=True, random_state=0)
            fitted = process.fit(self.table.coordinates, clipped.mean(axis=1)).kernel_.k1
        offset = clipped.mean(axis=0)
        covariance = fitted(self.table.coordinates)
        covariance += _NUGGET * covariance[0, 0] * np.eye(len(covariance))
        return fitted, np.linalg.solve(covariance, clipped - offset), offset

    def aims(self, points: Array) -> dict[str, Array]:
        """(M, F) of each kind of prediction at points (M, P)."""
        inside = np.clip(points, self._low, self._high)
        return {
            name: kernel(inside, self.table.coordinates) @ weights + offset  # type: ignore[operator]
            for name, (kernel, weights, offset) in self._fits.items()
        }

    def objected(self, points: Array) -> npt.NDArray[np.bool_]:
        """(M,) as of the nearest set that was tried."""
        apart = ((points[:, None] - self.table.coordinates[None]) ** 2).sum(axis=-1)
        return np.asarray(self.table.objected[apart.argmin(axis=1)])

    @cached_property
    def left_out_errors(self) -> dict[str, Array]:
        """(N, F) of each kind: by how much a set is mistaken that is emulated from the others (exact for a Gaussian
        process, Rasmussen and Williams 2006, eq. 5.12)."""
        found = {}
        for name, (kernel, weights, _) in self._fits.items():
            covariance = kernel(self.table.coordinates)  # type: ignore[operator]
            covariance += _NUGGET * covariance[0, 0] * np.eye(len(covariance))
            found[name] = weights / np.diag(np.linalg.inv(covariance))[:, None]
        return found


@dataclass(frozen=True, eq=False)
class EmulatedGround:
    """A search's ground on emulated flights, named by their number.

    Attributes
    ----------
    signs : (F,) None: the flights as they are; else each flight's surface less the mean over all, turned by its sign,
        so that no set is better than another but on single flights
    objects : whether vetoes count
    """

    emulator: Emulator
    signs: Array | None = None
    objects: bool = True

    def differences(self, base: Values, sets: Sequence[Values]) -> tuple[Array, dict[str, Array]]:
        """(M, F) score and kinds of prediction of sets less those of a base."""
        points = self._points([base, *sets])
        aims = {name: self._as_asked(values) for name, values in self.emulator.aims(points).items()}
        aims = {name: values[1:] - values[:1] for name, values in aims.items()}
        score = sum(self.emulator.table.weights[name] * values for name, values in aims.items())
        return np.asarray(score), aims

    def compare(self, asks: Sequence[tuple[Sequence[str], Ask]]) -> list[Comparison]:
        """Compare the sets of each ask with its base on some flights."""
        return [self._compared([int(name) for name in flights], ask) for flights, ask in asks]

    def _compared(self, places: Sequence[int], ask: Ask) -> Comparison:
        score, aims = self.differences(ask.base, ask.sets)
        objected = self.emulator.objected(self._points(ask.sets)) if self.objects else [False] * len(ask.sets)
        objections = tuple(("emulated",) if one else () for one in objected)
        return Comparison(score[:, places], {name: one[:, places] for name, one in aims.items()}, objections)

    def _as_asked(self, values: Array) -> Array:
        return values if self.signs is None else (values - values.mean(axis=1, keepdims=True)) * self.signs

    def _points(self, sets: Sequence[Values]) -> Array:
        named = [dict(one) for one in sets]
        factors = self.emulator.table.factors
        rows = [[f.coordinate(one.get(f.parameter, f.origin)) for f in factors] for one in named]
        return np.array(rows).reshape(len(rows), len(factors))
