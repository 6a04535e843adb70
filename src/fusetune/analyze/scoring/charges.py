"""What counts for a set where it has nothing of its own to show: what it lacks, and what follows its own resets.

Which measurements and gaps are scored, the mask, follows from the present set and the log alone. Another set can only
cost itself:

* **Lacking**: it has no prediction, or one that is no number, or had not yet fused the source once. It counts with the
  largest error that counts at all, the limit beyond which errors are clipped. One measurement alone that was passed
  over while the source was in use (another delay makes the estimator skip another one) says nothing, nor does a gap
  with no measurement just before one horizon: it counts with the present set's error or its own usual one, whichever is
  larger.
* **After a reset of its own**: a reset sets the state to the measurement and so hides the error that led to it. Until
  `reset_cut_s` after it, its error counts as no smaller than the present set's at the same measurement, and its
  variance as its usual one, for a reset sets that, too.

So neither what a reset makes small nor what is not there can make a score better. Nor has another set a say in the limit
beyond which errors are clipped, which is the present set's: with or without it the others' scores are the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class EvidenceCost:
    """What of the mask of a flight a set cost itself: numbers of measurements, or of gaps.

    Attributes
    ----------
    mask : of the present set
    lacking : that the set lacks
    after_reset : that it has, but that follow a reset of its own
    """

    mask: int
    lacking: int
    after_reset: int

    @property
    def lacking_percent(self) -> float:
        return 100.0 * self.lacking / self.mask if self.mask else 0.0

    @property
    def lost_percent(self) -> float:
        """Share of the mask that is not what the set itself predicted."""
        return 100.0 * (self.lacking + self.after_reset) / self.mask if self.mask else 0.0


@dataclass(frozen=True, eq=False)
class OwnEvidence:
    """What of N measurements, or gaps, of the mask a set has itself.

    Attributes
    ----------
    lacking, after_reset : (N,) where the set lacks one, and where one that it has follows a reset of its own
    has_own_resets : whether it has any on the flight
    """

    lacking: Flags
    after_reset: Flags
    has_own_resets: bool

    @property
    def cost(self) -> EvidenceCost:
        return EvidenceCost(self.lacking.size, int(self.lacking.sum()), int(self.after_reset.sum()))

    @property
    def is_complete(self) -> bool:
        """Whether it lacks none and has no reset of its own, so that all counts as it is."""
        return not (self.lacking.any() or self.has_own_resets)


@dataclass(frozen=True)
class Charged:
    """Errors and variances (N,) as they count."""

    error: Array
    variance: Array


def charged(
    error: Array,
    variance: Array,
    present: Array,
    lacking: Flags,
    after_reset: Flags,
    limit: float,
    alone: Flags | None = None,
) -> Charged:
    """Errors of one set as they count beside the present set's.

    Parameters
    ----------
    error, variance : (N,) innovations or errors of the set and their variances, at the scored measurements in order of
        time; what stands where it is lacking does not matter
    present : (N,) those of the present set
    lacking, after_reset : (N,) where the set lacks one, and where one follows a reset of its own
    limit : beyond which errors are clipped; where it is not finite, the largest error of the present set stands for it
    alone : where what is lacking says nothing, from `passed_over`; by default nowhere
    """
    own = ~lacking & ~after_reset
    known = own if own.any() else ~lacking
    usual = float(np.sqrt(np.mean(np.square(np.clip(error[known], -limit, limit))))) if known.any() else 0.0
    largest = limit if np.isfinite(limit) else float(np.max(np.abs(present), initial=usual))
    least = np.select(
        [np.zeros_like(lacking) if alone is None else alone, lacking, after_reset],
        [np.maximum(np.abs(present), usual), largest, np.abs(present)],
        default=0.0,
    )
    magnitude = np.maximum(np.where(lacking, 0.0, np.abs(error)), least)
    changed = lacking | (magnitude > np.abs(error))
    sign = np.where(present < 0.0, -1.0, 1.0)
    counted = np.where(changed, sign * magnitude, error)
    return Charged(counted, np.where(own, variance, _usual_variance(variance[known])))


def passed_over(lacking: Flags) -> Flags:
    """True where one measurement alone is lacking between two that are there; beyond either end counts as there."""
    there = np.r_[True, ~lacking, True]
    return np.asarray(lacking & there[:-2] & there[2:])


def _usual_variance(variance: Array) -> float:
    """Lower median, one of the values themselves; 1 where there are none, and all is lacking."""
    if not variance.size:
        return 1.0
    middle = (variance.size - 1) // 2
    return float(np.partition(variance, middle)[middle])
