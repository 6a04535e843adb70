"""The errors of a velocity source and of the inertial solution, found by maximum likelihood.

The measurement's error is white noise σ_w plus, where the data say so, a Gauss-Markov process (σ_c, τ); the velocity
of the inertial solution walks with density q. All four scale together: with σ_c/σ_w, q/σ_w and τ given, the scale that
makes the measurements most probable is s² = cost/n, and what is left to compare is n ln s² + ln det. So three ratios
are searched, each on a grid of factors of two, from the best of a coarse first look.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from fusetune.analyze.smoothing.linear_smoother import LinearModel, smooth

FIRST_RATIOS = (0.02, 0.08, 0.3)
"""Of q/σ_w, √Hz: PX4's defaults, 0.35 m/s² at 100 Hz beside 0.3 m/s, stand for 0.1."""
CORRELATION_TIMES_S = (0.5, 1.0, 2.0, 4.0, 8.0)
NEEDED_GAIN = 6.0
"""In −2 ln L, for two more figures: Akaike's criterion asks for 4."""
_RATIO_LIMITS = (0.005, 2.0)
_SHARE_LIMITS = (0.125, 16.0)
_STEPS = 5


@dataclass(frozen=True)
class ErrorModel:
    """Noises; without a correlation time the measurement's error is white.

    Attributes
    ----------
    white : σ_w, m/s
    correlated : σ_c, m/s
    correlation_time_s : τ; 0 for none
    walk : q, m/s/√s
    """

    white: float
    correlated: float
    correlation_time_s: float
    walk: float

    @property
    def is_white(self) -> bool:
        return self.correlation_time_s == 0.0

    def scaled(self, factor: float) -> ErrorModel:
        """All noises times a factor."""
        return replace(
            self, white=self.white * factor, correlated=self.correlated * factor, walk=self.walk * factor
        )


@dataclass(frozen=True)
class _Found:
    score: float
    errors: ErrorModel


Builder = Callable[[ErrorModel], Sequence[LinearModel]]
"""Models of the stretches of a flight, under given noises."""


def likeliest_errors(build: Builder, first: ErrorModel) -> ErrorModel:
    """The noises under which the measurements are most probable, from a white first guess."""

    def scored(errors: ErrorModel) -> _Found:
        models = build(errors)
        found = [smooth(model) for model in models]
        count = sum(model.measured.size for model in models)
        scale = sum(one.cost for one in found) / count
        score = count * math.log(scale) + sum(one.log_determinant for one in found)
        return _Found(score, errors.scaled(math.sqrt(scale)))

    def best(candidates: Iterable[ErrorModel]) -> _Found:
        return min((scored(one) for one in candidates), key=lambda one: one.score)

    plain = best(replace(first, walk=first.white * ratio) for ratio in FIRST_RATIOS)
    plain = _climbed(plain, _walk_step, scored)
    correlated = best(
        replace(plain.errors, correlated=plain.errors.white, correlation_time_s=time) for time in CORRELATION_TIMES_S
    )
    correlated = _climbed(correlated, _share_step, scored)
    correlated = _climbed(correlated, _walk_step, scored)
    correlated = _climbed(correlated, _time_step, scored)
    return (correlated if correlated.score < plain.score - NEEDED_GAIN else plain).errors


Step = Callable[[ErrorModel, float], ErrorModel | None]


def _climbed(start: _Found, step: Step, scored: Callable[[ErrorModel], _Found]) -> _Found:
    """Follow one ratio in factors of two while that makes the measurements more probable."""
    best = start
    for direction in (2.0, 0.5):
        for _ in range(_STEPS):
            candidate = step(best.errors, direction)
            found = scored(candidate) if candidate is not None else None
            if found is None or found.score >= best.score:
                break
            best = found
        if best is not start:
            break
    return best


def _walk_step(errors: ErrorModel, factor: float) -> ErrorModel | None:
    ratio = errors.walk * factor / errors.white
    return replace(errors, walk=errors.walk * factor) if _within(ratio, _RATIO_LIMITS) else None


def _share_step(errors: ErrorModel, factor: float) -> ErrorModel | None:
    ratio = errors.correlated * factor / errors.white
    return replace(errors, correlated=errors.correlated * factor) if _within(ratio, _SHARE_LIMITS) else None


def _time_step(errors: ErrorModel, factor: float) -> ErrorModel | None:
    time = errors.correlation_time_s * factor
    limits = CORRELATION_TIMES_S[0], CORRELATION_TIMES_S[-1]
    return replace(errors, correlation_time_s=time) if _within(time, limits) else None


def _within(value: float, limits: tuple[float, float]) -> bool:
    return limits[0] <= value <= limits[1]
