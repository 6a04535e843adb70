"""When a figure of a vehicle changed, or that it drifts, beyond what the order of its flights does by chance.

Figures of one fleet are many, hang together, and are anything but normal: shares that are mostly 0, maxima, times. So
both tests go by ranks, and chance is what shuffled flights show: all figures are shuffled together, and the largest
statistic of any of them is the one that a figure has to exceed. That keeps the chance of a single false alarm among all
figures at the level, however they depend on each other (Westfall and Young, Resampling-based multiple testing, 1993).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.stats import rankdata, theilslopes

from fusetune.apply.fleet.flights import OF_FLIGHT, FigureName, FleetFlight, FleetTable
from fusetune.apply.fleet.levels import FEWEST_A_SIDE, LEVEL

Array = npt.NDArray[np.float64]

SHUFFLES = 1999
_PER_FLIGHTS = 10


@dataclass(frozen=True)
class Change:
    """A step.

    Attributes
    ----------
    flight, date : the first flight after it
    before, after : medians
    flights_before, flights_after : their numbers, up to the change before and to the next one
    chance : of a step so clear in any figure of a vehicle whose flights could be in any order
    along : what else is another than on the flight before: "firmware", "mission"
    """

    vehicle: str
    id: str
    unit: str
    flight: str
    date: str
    before: float
    after: float
    flights_before: int
    flights_after: int
    chance: float
    along: tuple[str, ...]


@dataclass(frozen=True)
class Drift:
    """A trend, where no step tells it better.

    Attributes
    ----------
    per_ten_flights, lower, upper : Theil and Sen's slope, with its 95 % interval
    chance : as of a step
    """

    vehicle: str
    id: str
    unit: str
    flights: int
    per_ten_flights: float
    lower: float
    upper: float
    chance: float


def changes(table: FleetTable) -> tuple[tuple[Change, ...], tuple[Drift, ...]]:
    """Steps and drifts of all vehicles that have enough dated flights; the least likely first."""
    columns = [place for place, one in enumerate(table.figures) if one.group != OF_FLIGHT]
    tried = [rows for vehicle in table.vehicles if (rows := _dated(table, vehicle)).size >= 2 * FEWEST_A_SIDE]
    steps: list[Change] = []
    drifts: list[Drift] = []
    for rows in tried:
        flights = [table.flights[row] for row in rows]
        found = _of_vehicle(flights, [table.figures[one] for one in columns], table.values[rows][:, columns],
                            LEVEL / len(tried))  # fmt: skip
        steps += found[0]
        drifts += found[1]
    return (
        tuple(sorted(steps, key=lambda one: (one.chance, one.id, one.flight))),
        tuple(sorted(drifts, key=lambda one: (one.chance, one.id))),
    )


def _dated(table: FleetTable, vehicle: str) -> npt.NDArray[np.intp]:
    rows = table.rows_of(vehicle)
    return rows[[bool(table.flights[row].date) for row in rows]] if rows.size else rows


def _of_vehicle(
    flights: list[FleetFlight], figures: list[FigureName], values: Array, level: float
) -> tuple[list[Change], list[Drift]]:
    """Steps and drifts in the rows of one vehicle, which are in the order of time."""
    varied = np.flatnonzero([np.unique(one[np.isfinite(one)]).size > 1 for one in values.T])
    if not varied.size:
        return [], []
    values, figures = values[:, varied], [figures[one] for one in varied]
    step_chance = family_chances(values, largest_steps)
    drift_chance = family_chances(values, rank_correlations)
    stepped = np.flatnonzero(step_chance <= level)
    steps: list[Change] = []
    drifts: list[Drift] = []
    for column in np.flatnonzero((step_chance <= level) | (drift_chance <= level)).tolist():
        known = np.flatnonzero(np.isfinite(values[:, column]))
        series = values[known, column]
        edges = [(0, 1.0)]
        if column in stepped:
            edges = [(0, 1.0), *_edges(series, float(step_chance[column]), 0.5 * level / stepped.size)]
        misfit = _misfit_of_steps(series, [start for start, _ in edges[1:]])
        if drift_chance[column] > level or _misfit_of_line(series) >= misfit:
            steps += _told_steps(flights, figures[column], known, series, edges)
            continue
        drift = _drift(flights, figures[column], series, float(drift_chance[column]))
        usual = float(np.median(series))
        if figures[column].matters(usual + drift.per_ten_flights * series.size / _PER_FLIGHTS, usual):
            drifts.append(drift)
    return steps, drifts


Statistic = Callable[[Array, Array, npt.NDArray[np.bool_]], Array]
"""Of centred ranks (n, K), their sums of squares (K,) and which are known (n, K), in the order of time: (K,)."""


def family_chances(values: Array, statistic: Statistic) -> Array:
    """Chance that flights in any order show a statistic as large in any figure.

    Parameters
    ----------
    values : (n, K), in the order of time; NaN where a flight does not tell a figure
    """
    known = np.isfinite(values)
    ranks = rankdata(values, axis=0, nan_policy="omit")
    centred = np.where(known, ranks - np.nanmean(ranks, axis=0), 0.0)
    squares = (centred**2).sum(axis=0)
    seen = statistic(centred, squares, known)
    draw = np.random.default_rng(0)
    reached = np.ones(values.shape[1])
    for _ in range(SHUFFLES):
        order = draw.permutation(len(values))
        reached += statistic(centred[order], squares, known[order]).max() >= seen - 1e-9
    return reached / (SHUFFLES + 1)


def largest_steps(centred: Array, squares: Array, known: npt.NDArray[np.bool_]) -> Array:
    """Largest standardised rank sum (Wilcoxon's) over all places at which the flights can be divided."""
    return _step_sizes(centred, squares, known).max(axis=0)


def _step_sizes(centred: Array, squares: Array, known: npt.NDArray[np.bool_]) -> Array:
    """(n, K) by the last flight before the step: drawn without replacement, a sum of n₁ of n ranks has the variance
    n₁n₂/n · Σc²/(n−1)."""
    n = known.sum(axis=0)
    before = np.cumsum(known, axis=0)
    variance = before * (n - before) / np.maximum(n, 1) * squares / np.maximum(n - 1, 1)
    enough = (before >= FEWEST_A_SIDE) & (n - before >= FEWEST_A_SIDE) & (variance > 0.0)
    return np.where(enough, np.abs(np.cumsum(centred, axis=0)) / np.sqrt(np.where(enough, variance, 1.0)), 0.0)


def rank_correlations(centred: Array, squares: Array, known: npt.NDArray[np.bool_]) -> Array:
    """|ρ|·√(n−1) with Spearman's ρ against the order of the flights."""
    n = known.sum(axis=0)
    place = np.where(known, np.cumsum(known, axis=0) - (n + 1) / 2, 0.0)
    scale = np.sqrt((place**2).sum(axis=0) * squares)
    enough = (n >= 2 * FEWEST_A_SIDE) & (scale > 0.0)
    correlation = np.abs((centred * place).sum(axis=0)) / np.where(enough, scale, 1.0)
    return np.where(enough, correlation * np.sqrt(np.maximum(n - 1, 0)), 0.0)


def _edges(series: Array, chance: float, level: float) -> list[tuple[int, float]]:
    """Where the parts of a series begin that has a step, with the chance of each; halves are searched for further
    ones at half the level, each by itself."""
    place = _best_place(series)
    found = [(place, chance)]
    for offset, part in ((0, series[:place]), (place, series[place:])):
        if part.size >= 2 * FEWEST_A_SIDE and np.unique(part).size > 1:
            inner = float(family_chances(part[:, None], largest_steps)[0])
            if inner <= level:
                found += [(offset + start, one) for start, one in _edges(part, inner, 0.5 * level)]
    return sorted(found)


def _best_place(series: Array) -> int:
    """The first row after the step: where two medians leave the least; of equal ones where the ranks differ most.

    That they differ says that there is a step. Where it is they tell less well: as long as both sides are apart, the
    larger statistic is that of the more even division.
    """
    centred = rankdata(series)[:, None] - 0.5 * (series.size + 1)
    sizes = _step_sizes(centred, (centred**2).sum(axis=0), np.ones(centred.shape, dtype=bool))[:, 0]
    places = range(FEWEST_A_SIDE, series.size - FEWEST_A_SIDE + 1)
    return min(places, key=lambda place: (_misfit_of_steps(series, [place]), -sizes[place - 1]))


def _misfit_of_line(series: Array) -> float:
    slope, intercept, _, _ = theilslopes(series)
    return float(np.abs(series - intercept - slope * np.arange(series.size)).sum())


def _misfit_of_steps(series: Array, places: Sequence[int]) -> float:
    parts = np.split(series, places)
    return float(sum(np.abs(part - np.median(part)).sum() for part in parts))


def _told_steps(
    flights: list[FleetFlight],
    figure: FigureName,
    known: npt.NDArray[np.intp],
    series: Array,
    edges: list[tuple[int, float]],
) -> list[Change]:
    starts = [*(start for start, _ in edges), series.size]
    found = []
    for (start, chance), before, stop in zip(edges[1:], starts, starts[2:], strict=False):
        first, last = flights[known[start]], flights[known[start - 1]]
        medians = float(np.median(series[before:start])), float(np.median(series[start:stop]))
        if not figure.matters(medians[1], medians[0]):
            continue
        found.append(
            Change(
                first.vehicle,
                figure.id,
                figure.unit,
                first.name,
                first.date,
                *medians,
                start - before,
                stop - start,
                chance,
                tuple(what for what in ("firmware", "mission") if getattr(first, what) != getattr(last, what)),
            )
        )
    return found


def _drift(flights: list[FleetFlight], figure: FigureName, series: Array, chance: float) -> Drift:
    found = theilslopes(series)
    slope, lower, upper = (float(_PER_FLIGHTS * one) for one in (found.slope, found.low_slope, found.high_slope))
    return Drift(flights[0].vehicle, figure.id, figure.unit, series.size, slope, lower, upper, chance)
