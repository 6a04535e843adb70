"""Counts compared as counts: by how much one rate of events is larger than another, and how sure that is."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fusetune.analyze.metrics.break_rate import clopper_pearson


@dataclass(frozen=True)
class RateRatio:
    """Ratio of two rates of events with its exact interval; `upper` is infinite where the second has none."""

    lower: float
    upper: float

    @property
    def is_larger(self) -> bool:
        """The first rate is larger beyond doubt."""
        return self.lower > 1.0


def rate_ratio(count: int, exposure: float, base: int, base_exposure: float, confidence: float) -> RateRatio:
    """Interval of the ratio of two Poisson rates.

    Given the sum of both counts, the first is binomial with p = λ₁E₁ / (λ₁E₁ + λ₂E₂), so the Clopper–Pearson bounds of
    p give those of λ₁/λ₂ = p/(1 − p) · E₂/E₁. Without any event, nothing is known.

    Parameters
    ----------
    count, base : numbers of events
    exposure, base_exposure : time over which each was counted, in any unit, above 0

    References
    ----------
    Przyborowski and Wilenski, "Homogeneity of results in testing samples from Poisson series", Biometrika 31, 1940.
    """
    if count + base == 0:
        return RateRatio(0.0, math.inf)
    share = clopper_pearson(count, count + base, confidence)
    lower, upper = (_odds(float(bound)) * base_exposure / exposure for bound in (share.lower, share.upper))
    return RateRatio(lower, upper)


def _odds(share: float) -> float:
    return share / (1.0 - share) if share < 1.0 else math.inf
