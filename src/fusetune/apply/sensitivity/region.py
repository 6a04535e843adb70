"""Where the parameters are looked at: what was tried of each, and the neighbourhood in which it is asked what matters.

A pilot asks what matters here, not what would matter eight times off: far away everything does. The neighbourhood
reaches from the present set and the incumbent, and what lies between them, as far again as a careful change would:
a factor of two, on a linear scale a sixth of the range. Nothing is said beyond what was tried.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.apply.trials import Trials

Array = npt.NDArray[np.float64]

NEAR_RATIO = 2.0
NEAR_SHARE = 1.0 / 6.0


@dataclass(frozen=True, eq=False)
class Region:
    """Coordinates, one of each factor.

    Attributes
    ----------
    centre : (P,) of the incumbent, which need not have been tried
    low, high : (P,) ends of what was tried, inside the factors' bounds; the present set and the incumbent are inside
    near_low, near_high : (P,) ends of the neighbourhood
    """

    centre: Array
    low: Array
    high: Array
    near_low: Array
    near_high: Array

    def along(self, index: int, coordinates: Array) -> Array:
        """(M, P) places that differ from the centre in one factor."""
        places = np.tile(self.centre, (len(coordinates), 1))
        places[:, index] = coordinates
        return places


def region_of(trials: Trials, centre: Array) -> Region:
    """The region of some trials around an incumbent's coordinates (P,)."""
    with_present = np.vstack([trials.coordinates, np.zeros_like(centre), centre])
    bounds = np.array([factor.bounds for factor in trials.factors])
    low = np.maximum(with_present.min(axis=0), np.minimum(bounds[:, 0], np.minimum(centre, 0.0)))
    high = np.minimum(with_present.max(axis=0), np.maximum(bounds[:, 1], np.maximum(centre, 0.0)))
    reach = np.array([_reach(trials, index) for index in range(len(trials.factors))])
    near_low = np.maximum(low, np.minimum(centre, 0.0) - reach)
    near_high = np.minimum(high, np.maximum(centre, 0.0) + reach)
    return Region(centre, low, high, near_low, near_high)


def _reach(trials: Trials, index: int) -> float:
    factor = trials.factors[index]
    if factor.scale == "log":
        return float(np.log(NEAR_RATIO) / np.log(factor.unit_step))
    start, stop = factor.bounds
    return max(NEAR_SHARE * (stop - start), 1.0)
