"""The errors of the measurements and of the inertial solution, found by maximum likelihood.

The velocity measurement's error is white noise σ_w plus, where the data say so, a Gauss-Markov process (σ_c, τ); that
of a position or height is white noise and a walk; the velocity of the inertial solution walks with density q. All scale
together: with their ratios and τ given, the scale that makes the measurements most probable is s² = cost/n, and what is
left to compare is n ln s² + ln det. So the ratios are searched: from the best of a coarse first look one after the
other in factors of two, and from there down the slope.

A receiver that wanders over seconds and an inertial solution that walks explain the same measurements nearly as well.
What is known of the latter decides: q is log-normal around what an accelerometer on a vibrating frame has.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

from fusetune.analyze.smoothing.linear_smoother import Likelihood

Array = npt.NDArray[np.float64]

USUAL_WALK = 0.01
"""m/s/√s. Accelerometers of autopilots have 0.001 to 0.003, on a vibrating frame 0.01 to 0.06; PX4's default of
EKF2_ACC_NOISE, 0.35 m/s² at 100 Hz, stands for 0.035."""
WALK_SPREAD = 0.7
"""Standard deviation of ln q."""
FIRST_TIMES_S = (0.5, 1.0, 2.0, 4.0, 8.0)
FIRST_SHARES = (1.0, 3.0)
"""Of σ_c/σ_w."""
NEEDED_GAIN = 6.0
"""In −2 ln L, for two more figures: Akaike's criterion asks for 4."""
_RATIO_LIMITS = (0.01, 30.0)
_SHARE_LIMITS = (0.1, 20.0)
_TIME_LIMITS_S = (0.3, 10.0)
_SLOPE_STEP = 1e-4
_TOLERANCE = 3e-6
"""Of −2 ln L, which is some thousands."""
_MOST_STEPS = 8
_COARSE, _REACH = math.log(2.0), math.log(3.0)


@dataclass(frozen=True)
class PositionErrors:
    """Noises of a series of positions or heights: white, m, and a walk, m/√s."""

    white: float
    walk: float


@dataclass(frozen=True)
class ErrorModel:
    """Noises; without a correlation time the velocity measurement's error is white.

    Attributes
    ----------
    white : σ_w, m/s
    correlated : σ_c, m/s
    correlation_time_s : τ; 0 for none
    walk : q, m/s/√s
    positions : of each series of positions or heights
    """

    white: float
    correlated: float
    correlation_time_s: float
    walk: float
    positions: tuple[PositionErrors, ...] = ()

    @property
    def is_white(self) -> bool:
        """Whether the error of the velocity measurement is."""
        return self.correlation_time_s == 0.0

    def scaled(self, factor: float) -> ErrorModel:
        """All noises times a factor."""
        return replace(
            self,
            white=self.white * factor,
            correlated=self.correlated * factor,
            walk=self.walk * factor,
            positions=tuple(PositionErrors(one.white * factor, one.walk * factor) for one in self.positions),
        )


class Likely(Protocol):
    """A stretch of a flight: how many measurements it has, and how probable they are under given noises."""

    @property
    def measurements(self) -> int: ...

    def likelihood(self, errors: ErrorModel) -> Likelihood: ...


def likeliest_errors(stretches: Sequence[Likely], first: ErrorModel) -> ErrorModel:
    """The noises under which the measurements are most probable, from a white first guess."""
    search = _Search(stretches)
    plain = search.down_the_slope(search.climbed(search.at(first)))
    looked = min((search.at(one) for one in _correlated(plain.errors)), key=lambda one: one.score)
    correlated = search.down_the_slope(looked)
    return (correlated if correlated.score < plain.score - NEEDED_GAIN else plain).errors


def _correlated(white: ErrorModel) -> Iterator[ErrorModel]:
    """A first look at errors that are correlated in time, with an inertial solution as it usually is."""
    for time in FIRST_TIMES_S:
        for share in FIRST_SHARES:
            yield replace(white, walk=USUAL_WALK, correlated=share * white.white, correlation_time_s=time)


@dataclass(frozen=True)
class _Found:
    """−2 ln L without its constant, with the prior of the walk; and the noises at their best scale."""

    score: float
    errors: ErrorModel


class _Search:
    """Of the most probable ratios of all noises to σ_w, in logarithms."""

    def __init__(self, stretches: Sequence[Likely]) -> None:
        self._stretches = stretches
        self._count = sum(one.measurements for one in stretches)

    def at(self, errors: ErrorModel) -> _Found:
        """Noises in these ratios."""
        found = [one.likelihood(errors) for one in self._stretches]
        scale = sum(one.cost for one in found) / self._count
        errors = errors.scaled(math.sqrt(scale))
        score = self._count * math.log(scale) + sum(one.log_determinant for one in found)
        return _Found(score + (math.log(errors.walk / USUAL_WALK) / WALK_SPREAD) ** 2, errors)

    def climbed(self, best: _Found) -> _Found:
        """One ratio after the other in factors of two, as long as that helps."""
        for place in reversed(range(_ratios(best.errors).size)):
            best = self._along(place, best)
        return best

    def _along(self, place: int, start: _Found) -> _Found:
        best, (low, high) = start, _bounds(start.errors)[place]
        for step in (_COARSE, -_COARSE):
            while True:
                ratios = _ratios(best.errors)
                ratios[place] += step
                if not low <= ratios[place] <= high:
                    break
                found = self.at(_with_ratios(best.errors, ratios))
                if found.score >= best.score:
                    break
                best = found
            if best is not start:
                break
        return best

    def down_the_slope(self, start: _Found) -> _Found:
        """To where all ratios together are best, no further off than by a factor."""
        errors, centre = start.errors, _ratios(start.errors)

        def score(ratios: Array) -> float:
            return self.at(_with_ratios(errors, ratios)).score

        found = minimize(
            score,
            centre,
            method="L-BFGS-B",
            bounds=[(float(one) - _REACH, float(one) + _REACH) for one in centre],
            options={"eps": _SLOPE_STEP, "ftol": _TOLERANCE, "maxiter": _MOST_STEPS},
        )
        return self.at(_with_ratios(errors, found.x))


def _ratios(errors: ErrorModel) -> Array:
    """Logarithms of the noises against σ_w: the walk, those of positions; of a correlated error σ_c, and τ in s."""
    ratios = [errors.walk / errors.white]
    for one in errors.positions:
        ratios += [one.white / errors.white, one.walk / errors.white]
    if not errors.is_white:
        ratios += [errors.correlated / errors.white, errors.correlation_time_s]
    return np.log(ratios)


def _with_ratios(errors: ErrorModel, logarithms: Array) -> ErrorModel:
    walk, *others = (float(one) for one in np.exp(logarithms))
    places = range(0, 2 * len(errors.positions), 2)
    changed = replace(
        errors,
        walk=walk * errors.white,
        positions=tuple(PositionErrors(others[i] * errors.white, others[i + 1] * errors.white) for i in places),
    )
    if errors.is_white:
        return changed
    share, time = others[-2:]
    return replace(changed, correlated=share * errors.white, correlation_time_s=time)


def _bounds(errors: ErrorModel) -> list[tuple[float, float]]:
    limits = [_RATIO_LIMITS] * (1 + 2 * len(errors.positions))
    if not errors.is_white:
        limits += [_SHARE_LIMITS, _TIME_LIMITS_S]
    return [(math.log(low), math.log(high)) for low, high in limits]
