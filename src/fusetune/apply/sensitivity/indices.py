"""Sobol indices: which share of the score's variance over the neighbourhood each parameter brings.

References
----------
Sobol, "Global sensitivity indices for nonlinear mathematical models and their Monte Carlo estimates", Mathematics and
Computers in Simulation 55, 2001; the estimators are those of `scipy.stats.sobol_indices` (Saltelli et al. 2010).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.stats import qmc, sobol_indices

from fusetune.apply.sensitivity.region import Region
from fusetune.apply.sensitivity.surface import Surface

Array = npt.NDArray[np.float64]
Positions = npt.NDArray[np.intp]

_SAMPLES = 512
_DRAWS = 200
_FEWEST_FLIGHTS = 3


@dataclass(frozen=True, eq=False)
class Indices:
    """Shares of the variance, for P factors.

    Attributes
    ----------
    spread : standard deviation of the mean score over the neighbourhood, nat
    first : (P,) what each factor brings alone
    total : (P,) what it brings alone and together with others
    first_interval, total_interval : (P, 2) from redrawn flights; NaN with fewer than three
    """

    spread: float
    first: Array
    total: Array
    first_interval: Array
    total_interval: Array


def indices_of(
    surface: Surface, region: Region, told: npt.NDArray[np.bool_], confidence: float, seed: int
) -> Indices | None:
    """Indices of the surface's mean over the flights, coordinates uniform over the neighbourhood.

    Parameters
    ----------
    told : (P,) whether a factor's effect is told at all; the others stay with the incumbent and have no index (NaN)

    Returns
    -------
    None where fewer than two factors are told, as one brings all, and where the surface is level
    """
    varied = np.flatnonzero(told)
    if varied.size < 2:
        return None
    drawn = qmc.Sobol(2 * varied.size, seed=np.random.default_rng(seed)).random(_SAMPLES)
    low, high = region.near_low[varied], region.near_high[varied]
    one, other = (low + part * (high - low) for part in (drawn[:, : varied.size], drawn[:, varied.size :]))
    mixed = np.repeat(one[None], varied.size, axis=0)
    for index in range(varied.size):
        mixed[index, :, index] = other[:, index]
    values = [surface.at(_placed(places, varied, region)) for places in (one, other, mixed.reshape(-1, varied.size))]
    flights = values[0].shape[1]
    drawn_flights = np.random.default_rng(seed).integers(flights, size=(_DRAWS, flights))
    shares = np.array([np.bincount(row, minlength=flights) / flights for row in drawn_flights])
    weights = np.vstack([np.full(flights, 1.0 / flights), shares])
    of_one, of_other, of_mixed = (value @ weights.T for value in values)
    spread = float(np.std(np.concatenate([of_one[:, 0], of_other[:, 0]])))
    if spread < 1e-9:
        return None
    outputs: dict[Literal["f_A", "f_B", "f_AB"], Array] = {
        "f_A": of_one.T,
        "f_B": of_other.T,
        "f_AB": of_mixed.reshape(varied.size, _SAMPLES, -1).transpose(0, 2, 1),
    }
    found = sobol_indices(func=outputs, n=_SAMPLES)
    first, total = np.clip(found.first_order, 0.0, 1.0), np.maximum(found.total_order, 0.0)
    ends = (0.5 * (1.0 - confidence), 0.5 * (1.0 + confidence)) if flights >= _FEWEST_FLIGHTS else (math.nan, math.nan)
    figures = (first[0], total[0], _between(first[1:], ends), _between(total[1:], ends))
    return Indices(spread, *(_spread_out(figure, varied, len(told)) for figure in figures))


def _placed(coordinates: Array, varied: Positions, region: Region) -> Array:
    places = np.tile(region.centre, (len(coordinates), 1))
    places[:, varied] = coordinates
    return places


def _between(draws: Array, ends: tuple[float, float]) -> Array:
    """(P, 2) quantiles of draws (D, P); NaN where these are not known."""
    if not all(map(math.isfinite, ends)):
        return np.full((draws.shape[1], 2), np.nan)
    return np.asarray(np.quantile(draws, ends, axis=0).T)


def _spread_out(values: Array, varied: Positions, size: int) -> Array:
    """Values of the varied factors in places for all."""
    full = np.full((size, *values.shape[1:]), np.nan)
    full[varied] = values
    return full
