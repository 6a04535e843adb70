"""Paired hierarchical bootstrap: flights are redrawn, and in each drawn flight its blocks, alike for all sets."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr, stdtr, stdtrit

from fusetune.analyze.likelihood import profile_nll
from fusetune.apply.evidence import AIMS, AimEvidence, FlightEvidence

Array = npt.NDArray[np.float64]


FEWEST_FLIGHTS = 3
"""With fewer flights what differs between them says little, and the blocks speak for themselves."""


@dataclass(frozen=True)
class Interval:
    """Confidence interval of a mean difference."""

    lower: float
    upper: float

    @property
    def excludes_zero(self) -> bool:
        return self.lower > 0.0 or self.upper < 0.0


@dataclass(frozen=True)
class Redrawn:
    """Redrawn mean scores, (D, S) each: of the whole score, and of each aim alone where any flight speaks of it."""

    total: Array
    aims: dict[str, Array]


def bootstrap_scores(flights: Sequence[FlightEvidence], sets: Sequence[str], draws: int, seed: int) -> Redrawn:
    """Redraw the mean score of every set.

    Parameters
    ----------
    flights : evidence, F ≥ 1, in a fixed order
    sets : names, S; each must be scored on every flight
    draws : D
    seed : of the generator; the same seed gives the same draws on any number of cores

    Returns
    -------
    Mean scores. In one draw all sets see the same flights and blocks, so differences are paired. An aim's mean is
    over the drawn flights that have it, and NaN where none has.
    """
    generator = np.random.Generator(np.random.PCG64(seed))
    count = len(flights)
    drawn = generator.integers(0, count, size=(draws, count))
    total = np.zeros((draws, len(sets)))
    aims = {name: (np.zeros_like(total), np.zeros((draws, 1))) for name in AIMS}
    for index, flight in enumerate(flights):
        draw_of_slot = np.nonzero(drawn == index)[0]
        columns = np.array([flight.sets.index(name) for name in sets])
        for aim in flight.aims:
            scores = _redrawn_aim(aim, columns, draw_of_slot.size, generator)
            np.add.at(total, draw_of_slot, aim.weight * scores)
            np.add.at(aims[aim.name][0], draw_of_slot, scores)
            np.add.at(aims[aim.name][1], draw_of_slot, 1.0)
    with np.errstate(invalid="ignore"):
        means = {name: scores / number for name, (scores, number) in aims.items() if number.any()}
    return Redrawn(total / count, means)


def _redrawn_aim(aim: AimEvidence, columns: npt.NDArray[np.int64], slots: int, generator: np.random.Generator) -> Array:
    """(slots, S) scores of one aim of a flight whose blocks are drawn anew for each slot."""
    blocks, axes = aim.n.shape
    picks = generator.integers(0, blocks, size=(slots, blocks))
    cells = (np.arange(slots)[:, None] * blocks + picks).ravel()
    weights = np.bincount(cells, minlength=slots * blocks).reshape(slots, blocks).astype(np.float64)
    n = np.zeros((slots, 1, axes))
    nis = np.zeros((slots, columns.size, axes))
    log_variance = np.zeros_like(nis)
    # Summed block by block, not by a matrix product: its order of summation could change with the number of cores.
    for block in range(blocks):
        weight = weights[:, block, None, None]
        n += weight * aim.n[block]
        nis += weight * aim.sum_nis[columns, block]
        if aim.sum_log_variance.any():
            log_variance += weight * aim.sum_log_variance[columns, block]
    with np.errstate(invalid="ignore", divide="ignore"):
        scores = profile_nll(nis / n, log_variance / n)
    # A draw may hold none of the blocks in which a column has samples: then the column says what it says on the whole.
    scores = np.where(n > 0.0, scores, aim.column_scores[columns])
    return np.asarray((scores * aim.column_weights).sum(axis=-1))


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


def expanded_interval(differences: Array, flights: int, confidence: float) -> Interval:
    """Percentile interval, widened for the small number of flights.

    The plain percentile interval is as narrow as if the spread of a few flights were known. Its tails are moved
    to Φ(−√(F/(F−1)) t), with t the quantile of Student's distribution with F − 1 degrees of freedom.

    Parameters
    ----------
    differences : (D,) redrawn mean differences
    flights : F; with one flight only its blocks speak and nothing can be widened

    References
    ----------
    Hesterberg, "What Teachers Should Know About the Bootstrap", The American Statistician 69(4), 2015.
    """
    tail = 0.5 * (1.0 - confidence)
    if flights > 1:
        tail = float(ndtr(np.sqrt(flights / (flights - 1.0)) * stdtrit(flights - 1, tail)))
    lower, upper = np.quantile(differences, [tail, 1.0 - tail])
    return Interval(float(lower), float(upper))


def interval_over_flights(draws: Array, differences: Array, confidence: float) -> Interval:
    """Interval of a mean difference from its redrawn means (D,) and the differences on the flights (F,)."""
    return expanded_interval(spread_of_flights(draws, differences), differences.size, confidence)


def p_value(difference: float, differences: Array, flights: int) -> float:
    """Two-sided p-value of a mean difference against 0: Student's t with the bootstrap's standard error.

    With one flight the normal distribution stands in for Student's; 1 where the draws do not vary around 0.
    """
    error = float(np.std(differences))
    if flights > 1:
        error *= np.sqrt(flights / (flights - 1.0))
    if error == 0.0:
        return 1.0 if difference == 0.0 else 0.0
    statistic = -abs(difference) / error
    tail = stdtr(flights - 1, statistic) if flights > 1 else ndtr(statistic)
    return float(min(2.0 * tail, 1.0))


def holm(p_values: Sequence[float]) -> list[float]:
    """Holm's adjusted p-values in the order of the arguments: they hold for all candidates together."""
    order = np.argsort(p_values, kind="stable")
    adjusted = np.empty(len(p_values))
    largest = 0.0
    for rank, index in enumerate(order):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[index]))
        adjusted[index] = largest
    return [float(value) for value in adjusted]


def probability_best(scores: Array) -> Array:
    """Share of draws in which each set has the lowest score, (D, S) → (S,); equal sets share a draw."""
    best = scores == scores.min(axis=1, keepdims=True)
    return (best / best.sum(axis=1, keepdims=True)).mean(axis=0)
