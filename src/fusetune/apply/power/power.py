"""The chance that the decision finds a set that truly gains so much, by the number and the length of flights.

Flights are drawn: a planted set that gains so much and varies as sets of that size do here (`Spread`), beside the sets
that were tried, and the decision's own rule looks for it: the upper end of its moderated interval beyond the smallest
gain, and its place among flipped signs. The second way to be proved better, by the smoothed velocity alone, and vetoes
are left out. The sets that were tried are drawn with their means and covariances over the flights.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fusetune.apply.power.spread import MOST_RIVALS, Spread
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.statistics.moderated import PRIOR_FLIGHTS, Moderated, shares, steadied
from fusetune.apply.statistics.sign_flips import family_p_values

Array = npt.NDArray[np.float64]

GAINS_PERCENT = (5.0, 10.0, 20.0)
FLIGHTS = (4, 5, 6, 8, 10, 12, 16, 20, 30)
"""Numbers of flights that are tried; fewer than four can show nothing (`sign_flips`)."""

ENOUGH = 0.8
"""Chance of being found that is asked for."""

DRAWS = 300
TRIED = 40
"""Of the draws in which the gain is sure, so many are tried for luck."""
FLIPS = 512
"""Of signs, at most, in each of these: whether p is below 0.05 they tell well enough for a share."""

_ROUNDING = 1e-9


@dataclass(frozen=True)
class PowerCurve:
    """Chance that a gain is found, by the number of flights.

    Attributes
    ----------
    gain_percent : by how much its prediction errors are smaller
    times_longer : how much longer than those so far the flights are
    flights, chance : (N,) number of flights, and the chance, never falling
    """

    gain_percent: float
    times_longer: float
    flights: tuple[int, ...]
    chance: tuple[float, ...]

    @property
    def needed(self) -> int | None:
        """Fewest flights that find it with `ENOUGH`; None where more than the largest number tried are."""
        for index, chance in enumerate(self.chance):
            if chance >= ENOUGH:
                if not index:
                    return self.flights[0]
                before, low = self.flights[index - 1], self.chance[index - 1]
                share = (ENOUGH - low) / (chance - low)
                return before + math.ceil((self.flights[index] - before) * share - _ROUNDING)
        return None

    def at(self, flights: int) -> float:
        """Chance with a number of flights, interpolated; 0 with fewer than the fewest tried."""
        return float(np.interp(flights, self.flights, self.chance, left=0.0))


def power_curve(
    spread: Spread,
    gain_percent: float,
    settings: DecisionSettings,
    *,
    times_longer: float = 1.0,
    draws: int = DRAWS,
    numbers: Sequence[int] = FLIGHTS,
) -> PowerCurve:
    """The chance for each number of flights; the same draws for all, the first flights of each.

    Parameters
    ----------
    times_longer : how much longer than those so far the flights are
    """
    difference = math.log1p(-0.01 * gain_percent)
    factor = spread.factor(times_longer)
    generator = np.random.Generator(np.random.PCG64(settings.seed))
    rivals = _rivals(spread)
    own = generator.standard_normal((draws, max(numbers)))
    mixed = generator.standard_normal((draws, max(numbers), len(rivals)))
    # in any order, so that the first of the draws stand for all
    deviations = factor * generator.permutation(spread.of_gain(difference, draws))
    planted = difference + deviations[:, None] * own
    # mixing the flights' deviations by normal weights gives their covariances, whatever the number of sets
    others = rivals.mean(axis=0) + factor * (mixed @ (rivals - rivals.mean(axis=0))) / math.sqrt(len(rivals) - 1)
    chances: list[float] = []
    no_luck = 0.0
    for number in numbers:
        surely = _gain_surely(planted[:, :number], others[:, :number], settings)
        if no_luck < 1.0:
            # more flights are less often favoured by luck: once none of these is, none is any more
            tried = [np.column_stack([planted[i, :number], others[i, :number]]) for i in np.flatnonzero(surely)[:TRIED]]
            no_luck = float(np.mean([_is_no_luck(one, settings) for one in tried])) if tried else 0.0
        chances.append(max(float(surely.mean()) * no_luck, *chances, 0.0))
    return PowerCurve(gain_percent, times_longer, tuple(numbers), tuple(chances))


def _rivals(spread: Spread) -> Array:
    best = np.argsort(spread.differences.mean(axis=0), kind="stable")[:MOST_RIVALS]
    return spread.differences[:, np.sort(best)]


def _gain_surely(planted: Array, others: Array, settings: DecisionSettings) -> npt.NDArray[np.bool_]:
    """(D,) in which of the draws the planted set's interval, moderated by those of the others, lies beyond the smallest
    gain.

    Parameters
    ----------
    planted, others : (D, F) and (D, F, C) differences on the flights
    """
    flights, weight = planted.shape[1], min(PRIOR_FLIGHTS, others.shape[2])
    usual = np.median(shares(others.var(axis=1, ddof=1), np.square(others).mean(axis=1)), axis=1)
    variance, size = planted.var(axis=1, ddof=1), np.square(planted).mean(axis=1)
    error = np.sqrt(steadied(variance, size, usual, weight, flights) / flights)
    reach = Moderated(0.0, 1.0, flights - 1 + weight).reach(settings.confidence_of_a_change)
    return np.asarray(planted.mean(axis=1) + reach * error < settings.smallest_gain)


def _is_no_luck(differences: Array, settings: DecisionSettings) -> bool:
    """Whether the first of the sets (F, C) is better than the best of all by luck."""
    return bool(family_p_values(differences, settings.seed, FLIPS)[0] <= 1.0 - settings.confidence)


@dataclass(frozen=True)
class Power:
    """What the flights so far say of how many more it takes.

    Attributes
    ----------
    flights : that decide now
    minutes : of each that are scored, the mean
    within_share : share of the variance between flights that longer ones would lessen; None where not known
    curves : for flights as long as now, by gain
    longer : the same for flights of `LONGER_MINUTES`, where these are so short that it helps
    longer_factor : of the standard deviations, on such longer flights
    """

    flights: int
    minutes: float
    within_share: float | None
    curves: tuple[PowerCurve, ...]
    longer: tuple[PowerCurve, ...] = ()
    longer_factor: float = 1.0

    @property
    def next_minutes(self) -> float:
        """How long flights to come should be, in scored minutes."""
        return LONGER_MINUTES if self.longer else self.minutes

    def more(self, gain_percent: float) -> int | None:
        """Flights of `next_minutes` to be added until a gain is found with `ENOUGH`; 0 where those so far would do.

        None where more than the largest number tried are needed. Where the ones to come are longer, so many that the
        mean over all varies no more than over long ones alone: (F r + k) / (F + k)² ≤ 1 / N, for F short flights, whose
        variance is r times that of a long one, k long ones beside them and N that would do alone.
        """
        so_far = next(one for one in self.curves if one.gain_percent == gain_percent).needed
        if so_far is not None and so_far <= self.flights:
            return 0
        curves = self.longer or self.curves
        alone = next(one for one in curves if one.gain_percent == gain_percent).needed
        if alone is None:
            return None
        ratio = self.longer_factor**-2 if self.longer else 1.0
        enough = (k for k in range(1, 10 * alone) if alone * (self.flights * ratio + k) <= (self.flights + k) ** 2)
        return next(enough, None)

    def document(self) -> dict[str, Any]:
        """As `decision.json` holds it."""
        return {
            "flights": self.flights,
            "minutes": self.minutes,
            "within_share": self.within_share,
            "chance_asked_for": ENOUGH,
            "next_minutes": self.next_minutes,
            "more": {f"{gain:g}": self.more(gain) for gain in GAINS_PERCENT},
            "curves": [asdict(one) | {"needed": one.needed} for one in (*self.curves, *self.longer)],
        }


LONGER_MINUTES = 3.0
"""Where flights are shorter it is told what flights of this length would show."""
_LONG_ENOUGH = 0.7


def power_of(spread: Spread | None, minutes: float, settings: DecisionSettings) -> Power | None:
    """Power from the flights so far; None where they show no spread.

    Parameters
    ----------
    minutes : scored of each flight, the mean
    """
    if spread is None:
        return None
    curves = tuple(power_curve(spread, gain, settings) for gain in GAINS_PERCENT)
    if spread.within_share is None or minutes > _LONG_ENOUGH * LONGER_MINUTES or minutes <= 0.0:
        return Power(len(spread.differences), minutes, spread.within_share, curves)
    times = LONGER_MINUTES / minutes
    longer = tuple(power_curve(spread, gain, settings, times_longer=times) for gain in GAINS_PERCENT)
    return Power(len(spread.differences), minutes, spread.within_share, curves, longer, spread.factor(times))
