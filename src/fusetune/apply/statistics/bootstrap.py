"""Paired hierarchical bootstrap: flights are redrawn, and in each drawn flight its blocks, alike for all sets."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr, stdtr, stdtrit

from fusetune.analyze.metrics.likelihood import profile_nll
from fusetune.apply.evidence import AimEvidence, FlightEvidence
from fusetune.apply.statistics.rounding import EQUAL_WITHIN

Array = npt.NDArray[np.float64]


FEWEST_FLIGHTS = 3
"""With fewer flights what differs between them says little, and the blocks speak for themselves."""

FEWEST_REDRAWN = 5
"""With fewer units no draw lies as far out as Student's quantiles: of 4, one in 256 has one unit only, and the tail of
a 95 % interval is 1.2e-4."""

_FIGURES_AT_ONCE = 1 << 16
"""Of an array: half a megabyte, which stays in the processor's cache."""


@dataclass(frozen=True)
class Interval:
    """Confidence interval of a mean difference."""

    lower: float
    upper: float

    @property
    def excludes_zero(self) -> bool:
        return self.lower > 0.0 or self.upper < 0.0


def bootstrap_scores(
    flights: Sequence[FlightEvidence], sets: Sequence[str], draws: int, seed: int, aim: str | None = None
) -> Array:
    """Redraw the mean score of every set.

    Parameters
    ----------
    flights : evidence, F ≥ 1, in a fixed order
    sets : names, S; each must be scored on every flight
    draws : D
    seed : of the generator; the same seed gives the same draws on any number of cores
    aim : the score in this kind of prediction alone

    Returns
    -------
    (D, S) mean scores. In one draw all sets see the same flights and blocks, so differences are paired, and an aim
    sees what the whole score sees. An aim's mean is over the drawn flights that have it, and NaN where none has.
    """
    generator = np.random.Generator(np.random.PCG64(seed))
    count = len(flights)
    drawn = generator.integers(0, count, size=(draws, count))
    total, number = np.zeros((draws, len(sets))), np.zeros((draws, 1))
    for index, flight in enumerate(flights):
        draw_of_slot = np.nonzero(drawn == index)[0]
        rows = flight.rows_of(sets)
        for part in flight.aims:
            weights = _times_drawn(part.n.shape[0], draw_of_slot.size, generator)
            factor = part.weight if aim is None else float(part.name == aim)
            if factor > 0.0:
                number[:, 0] += np.bincount(draw_of_slot, minlength=draws)
                for slots, scores in _rescored(part, rows, weights):
                    for draw, one in zip(draw_of_slot[slots].tolist(), factor * scores, strict=True):
                        total[draw] += one
    with np.errstate(invalid="ignore"):
        return total / (count if aim is None else number)


def _times_drawn(blocks: int, slots: int, generator: np.random.Generator) -> Array:
    """(slots, blocks) how often each block is drawn for each slot."""
    picks = generator.integers(0, blocks, size=(slots, blocks))
    cells = (np.arange(slots)[:, None] * blocks + picks).ravel()
    return np.bincount(cells, minlength=slots * blocks).reshape(slots, blocks).astype(np.float64)


def _rescored(aim: AimEvidence, rows: npt.NDArray[np.int64], weights: Array) -> Iterator[tuple[slice, Array]]:
    """Scores of some sets with each block as often as a slot has drawn it: some of the slots, (N, S) theirs."""
    slots, columns = weights.shape[0], aim.n.shape[1]
    # sets stand last: there are a thousand of them, or few, but of columns always few
    nis = np.ascontiguousarray(aim.sum_nis[rows].transpose(1, 2, 0))
    log_variance = np.ascontiguousarray(aim.sum_log_variance[rows].transpose(1, 2, 0))
    has_variance = bool(aim.sum_log_variance.any())
    whole, no_variance = aim.column_scores[rows].T, np.zeros(1)
    at_once = max(1, _FIGURES_AT_ONCE // max(rows.size * columns, 1))
    for start in range(0, slots, at_once):
        some = slice(start, min(start + at_once, slots))
        weight = weights[some, :, None, None]
        n = _weighed_sum(weight, aim.n[:, :, None])
        mean_log_variance = _weighed_sum(weight, log_variance) if has_variance else no_variance
        with np.errstate(invalid="ignore", divide="ignore"):
            scores = profile_nll(_weighed_sum(weight, nis) / n, mean_log_variance / n)
        # Where a draw holds none of the blocks in which a column has samples, it says what it says on the whole.
        if not n.all():
            scores = np.where(n > 0.0, scores, whole)
        scores *= aim.column_weights[:, None]
        yield some, scores.sum(axis=1)


def _weighed_sum(weight: Array, figures: Array) -> Array:
    """(N, A, S) sums of the figures (B, A, S) of blocks, each so many times (N, B, 1, 1).

    Summed block by block, not by a matrix product: its order of summation could change with the number of cores.
    """
    total = weight[:, 0] * figures[0]
    part = np.empty_like(total)
    for block in range(1, len(figures)):
        total += np.multiply(weight[:, block], figures[block], out=part)
    return np.asarray(total)


def spread_of_flights(draws: Array, differences: Array) -> Array:
    """Bring the spread of redrawn means to that of redrawing flights alone.

    What differs from flight to flight already holds the noise within flights. Redrawing the blocks as well counts that
    noise twice, which makes intervals up to √2 too wide. From three flights on the draws are drawn together around
    their mean, by the factor between the two standard deviations; their shape stays.

    Parameters
    ----------
    draws : (D,) redrawn mean differences; NaN where a draw had no flight with evidence
    differences : (F,) differences on the flights

    References
    ----------
    Davison and Hinkley, "Bootstrap Methods and their Application", 1997, section 3.8.
    """
    draws = draws[np.isfinite(draws)]
    spread = float(np.std(draws))
    flights = float(np.std(differences)) / np.sqrt(differences.size)
    if differences.size < FEWEST_FLIGHTS or spread <= flights:
        return draws
    centre = draws.mean()
    return np.asarray(centre + (draws - centre) * (flights / spread))


def units_redrawn(flights: Sequence[FlightEvidence], aim: str | None = None) -> int:
    """How many things were redrawn whose differences show the spread: flights, or of a single flight its blocks.

    A flight whose blocks alone must show it has as many as the kind of prediction that has fewest.

    Parameters
    ----------
    aim : of this kind of prediction alone, on the flights that have it
    """
    having = [one for one in flights if aim is None or one.aim(aim) is not None]
    if len(having) != 1:
        return len(having)
    parts = [part for part in having[0].aims if aim is None or part.name == aim]
    return min(int(np.count_nonzero(part.n.any(axis=1))) for part in parts)


def standard_error(draws: Array, units: int) -> float | None:
    """Standard error of a mean difference from its redrawn means (D,); None where nothing shows its spread.

    The spread of redrawn means is that of the population, too small by √((n − 1)/n) for n units.
    """
    draws = draws[np.isfinite(draws)]
    if units < 2 or not draws.size:
        return None
    spread = float(np.std(draws))
    return spread * math.sqrt(units / (units - 1.0)) if spread > EQUAL_WITHIN else None


def expanded_interval(draws: Array, units: int, confidence: float) -> Interval | None:
    """Interval of a mean difference, widened for the small number of units; None where nothing shows its spread.

    The plain percentile interval is as narrow as if the spread of a few flights were known. Its tails are moved
    to Φ(−√(n/(n−1)) t), with t the quantile of Student's distribution with n − 1 degrees of freedom. With fewer than
    `FEWEST_REDRAWN` units, no draw lies there, and the interval is Student's own around the mean of the draws.

    Parameters
    ----------
    draws : (D,) redrawn mean differences; those that are not finite are left out
    units : n, from `units_redrawn`

    References
    ----------
    Hesterberg, "What Teachers Should Know About the Bootstrap", The American Statistician 69(4), 2015.
    """
    error = standard_error(draws, units)
    if error is None:
        return None
    draws = draws[np.isfinite(draws)]
    tail = 0.5 * (1.0 - confidence)
    quantile = float(stdtrit(units - 1, tail))
    if units < FEWEST_REDRAWN:
        centre = float(draws.mean())
        return Interval(centre + quantile * error, centre - quantile * error)
    tail = float(ndtr(np.sqrt(units / (units - 1.0)) * quantile))
    lower, upper = np.quantile(draws, [tail, 1.0 - tail])
    return Interval(float(lower), float(upper))


def p_value(difference: float, draws: Array, units: int) -> float | None:
    """Two-sided p-value of a mean difference against 0: Student's t with the bootstrap's standard error.

    1 where there is no difference beyond rounding, None where nothing shows how far it spreads.
    """
    if abs(difference) <= EQUAL_WITHIN:
        return 1.0
    error = standard_error(draws, units)
    if error is None or not np.isfinite(difference):
        return None
    return float(min(2.0 * stdtr(units - 1, -abs(difference) / error), 1.0))


def holm(p_values: Sequence[float | None]) -> list[float | None]:
    """Holm's adjusted p-values in the order of the arguments: they hold for all candidates together.

    One that is not known stays so; it counts as a candidate like the others.
    """
    known = [1.0 if one is None else one for one in p_values]
    adjusted: list[float | None] = [None] * len(known)
    largest = 0.0
    for rank, index in enumerate(np.argsort(known, kind="stable")):
        largest = max(largest, min(1.0, (len(known) - rank) * known[index]))
        adjusted[index] = None if p_values[index] is None else float(largest)
    return adjusted


def probability_best(scores: Array) -> Array:
    """Share of draws in which each set has the lowest score, (D, S) → (S,); equal sets share a draw."""
    best = scores <= scores.min(axis=1, keepdims=True) + EQUAL_WITHIN
    return (best / best.sum(axis=1, keepdims=True)).mean(axis=0)
