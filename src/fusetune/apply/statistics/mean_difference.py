"""By how much two sets differ over flights, and how sure that is."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.apply.evidence import FlightEvidence
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.statistics.bootstrap import (
    Interval,
    bootstrap_scores,
    expanded_interval,
    p_value,
    spread_of_flights,
    units_redrawn,
)
from fusetune.apply.statistics.moderated import Moderated, moderated
from fusetune.apply.statistics.rounding import without_rounding

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class MeanDifference:
    """Mean difference of two sets over flights, and its interval, which is None where nothing shows its spread.

    `p_value` is two-sided, against no difference; None where it is not known. `error` is the standard error of the mean
    over several flights, None where it is not known, and `freedom` its degrees of freedom.
    """

    difference: float
    lower: float | None
    upper: float | None
    flights: int
    p_value: float | None = None
    error: float | None = None
    freedom: float | None = None

    def upper_at(self, confidence: float) -> float | None:
        """Upper end of the interval at another level; None where it is not known, as of a single flight."""
        if self.error is None or self.freedom is None:
            return None
        return self.difference + Moderated(0.0, self.error, self.freedom).reach(confidence)

    @property
    def is_certain(self) -> bool:
        """The interval is known and does not hold 0."""
        return self.lower is not None and self.upper is not None and Interval(self.lower, self.upper).excludes_zero

    @property
    def is_worse(self) -> bool:
        """Above 0 beyond doubt: of scores, lower is better."""
        return self.lower is not None and self.lower > 0.0


def mean_differences(
    flights: Sequence[FlightEvidence], names: Sequence[str], settings: DecisionSettings, aim: str | None = None
) -> list[MeanDifference]:
    """Mean difference of each set's score to that of the first one.

    What differs between flights shows the spread (`moderated`); of a single flight, what differs between its blocks.

    Parameters
    ----------
    flights : at least one
    names : of sets that were scored on all of them, the present one first
    aim : in this kind of prediction alone; all flights have it
    """
    differences = without_rounding([one.differences(names, aim) for one in flights])
    if len(flights) == 1:
        return _of_blocks(flights, names, differences[0], settings, aim)
    found = []
    for one in moderated(differences):
        lower, upper = one.interval(settings.confidence) or (None, None)
        found.append(MeanDifference(one.mean, lower, upper, len(flights), one.p_value, one.error, one.freedom))
    return found


def _of_blocks(
    flights: Sequence[FlightEvidence],
    names: Sequence[str],
    differences: Array,
    settings: DecisionSettings,
    aim: str | None,
) -> list[MeanDifference]:
    scores = bootstrap_scores(flights, names, settings.draws, settings.seed, aim)
    units = units_redrawn(flights, aim)
    found = []
    for index, difference in enumerate(differences):
        draws = scores[:, index] - scores[:, 0]
        one = mean_difference(draws, np.array([difference]), units, settings.confidence)
        known = p_value(one.difference, draws, units)
        found.append(MeanDifference(one.difference, one.lower, one.upper, 1, known))
    return found


def mean_difference(draws: Array, differences: Array, units: int, confidence: float) -> MeanDifference:
    """Mean of the differences on the flights (F,), and its interval from its redrawn means (D,)."""
    interval = expanded_interval(spread_of_flights(draws, differences), units, confidence)
    lower, upper = (interval.lower, interval.upper) if interval else (None, None)
    return MeanDifference(float(np.mean(differences)), lower, upper, differences.size)
