"""The errors of a velocity source and of the inertial solution, found by maximum likelihood.

The measurement's error is white noise σ_w plus, where the data say so, a Gauss-Markov process (σ_c, τ); the velocity
of the inertial solution walks with density q. All four scale together: with σ_c/σ_w, q/σ_w and τ given, the scale that
makes the measurements most probable is s² = cost/n, and what is left to compare is n ln s² + ln det. So three ratios
are searched, each on a grid of factors of two, from the best of a coarse first look.

A receiver that wanders over seconds and an inertial solution that walks explain the same measurements nearly as well.
What is known of the latter decides: q is log-normal around what an accelerometer on a vibrating frame has.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from fusetune.analyze.smoothing.linear_smoother import LinearModel, smooth

USUAL_WALK = 0.01
"""m/s/√s. Accelerometers of autopilots have 0.001 to 0.003, on a vibrating frame 0.01 to 0.06; PX4's default of
EKF2_ACC_NOISE, 0.35 m/s² at 100 Hz, stands for 0.035."""
WALK_SPREAD = 0.7
"""Standard deviation of ln q."""
FIRST_SHARES = (1.0, 3.0)
"""Of σ_c/σ_w."""
CORRELATION_TIMES_S = (0.5, 1.0, 2.0, 4.0, 8.0)
NEEDED_GAIN = 6.0
"""In −2 ln L, for two more figures: Akaike's criterion asks for 4."""
_WALK_LIMITS = (0.0005, 1.0)
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
        errors = errors.scaled(math.sqrt(scale))
        score = count * math.log(scale) + sum(one.log_determinant for one in found)
        return _Found(score + (math.log(errors.walk / USUAL_WALK) / WALK_SPREAD) ** 2, errors)

    plain = _climbed(scored(replace(first, walk=USUAL_WALK)), _walk_step, scored)
    white = replace(plain.errors, walk=USUAL_WALK)
    correlated = min(
        (
            scored(replace(white, correlated=share * white.white, correlation_time_s=time))
            for time in CORRELATION_TIMES_S
            for share in FIRST_SHARES
        ),
        key=lambda one: one.score,
    )
    for step in (_share_step, _walk_step, _time_step, _share_step, _walk_step):
        correlated = _climbed(correlated, step, scored)
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
    walk = errors.walk * factor
    return replace(errors, walk=walk) if _within(walk, _WALK_LIMITS) else None


def _share_step(errors: ErrorModel, factor: float) -> ErrorModel | None:
    ratio = errors.correlated * factor / errors.white
    return replace(errors, correlated=errors.correlated * factor) if _within(ratio, _SHARE_LIMITS) else None


def _time_step(errors: ErrorModel, factor: float) -> ErrorModel | None:
    time = errors.correlation_time_s * factor
    limits = CORRELATION_TIMES_S[0], CORRELATION_TIMES_S[-1]
    return replace(errors, correlation_time_s=time) if _within(time, limits) else None


def _within(value: float, limits: tuple[float, float]) -> bool:
    return limits[0] <= value <= limits[1]
