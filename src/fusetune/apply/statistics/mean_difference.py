"""By how much two sets differ over flights, and how sure that is."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.apply.statistics.bootstrap import Interval, expanded_interval, spread_of_flights

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class MeanDifference:
    """Mean difference of two sets over flights, and its interval, which is None where nothing shows its spread."""

    difference: float
    lower: float | None
    upper: float | None
    flights: int

    @property
    def is_certain(self) -> bool:
        """The interval is known and does not hold 0."""
        return self.lower is not None and self.upper is not None and Interval(self.lower, self.upper).excludes_zero

    @property
    def is_worse(self) -> bool:
        """Above 0 beyond doubt: of scores, lower is better."""
        return self.lower is not None and self.lower > 0.0


def mean_difference(draws: Array, differences: Array, units: int, confidence: float) -> MeanDifference:
    """Mean of the differences on the flights (F,), and its interval from its redrawn means (D,)."""
    interval = expanded_interval(spread_of_flights(draws, differences), units, confidence)
    lower, upper = (interval.lower, interval.upper) if interval else (None, None)
    return MeanDifference(float(np.mean(differences)), lower, upper, differences.size)
