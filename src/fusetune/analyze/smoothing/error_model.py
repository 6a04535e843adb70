"""The errors of the measurements and of the inertial solution, found by maximum likelihood.

The velocity measurement's error is white noise σ_w plus, where the data say so, a Gauss-Markov process (σ_c, τ); that
of a position or height is white noise and a walk; the velocity of the inertial solution walks with density q. All scale
together: with their ratios and τ given, the scale that makes the measurements most probable is s² = cost/n, and what is
left to compare is n ln s² + ln det. So the ratios are searched, each in factors of two, from the best of a coarse first
look; the walk, which says over how long measurements are averaged, at last in factors of √2.

A receiver that wanders over seconds and an inertial solution that walks explain the same measurements nearly as well.
What is known of the latter decides: q is log-normal around what an accelerometer on a vibrating frame has.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

from fusetune.analyze.smoothing.linear_smoother import LinearModel, smooth

USUAL_WALK = 0.01
"""m/s/√s. Accelerometers of autopilots have 0.001 to 0.003, on a vibrating frame 0.01 to 0.06; PX4's default of
EKF2_ACC_NOISE, 0.35 m/s² at 100 Hz, stands for 0.035."""
WALK_SPREAD = 0.7
"""Standard deviation of ln q."""
CORRELATION_TIMES_S = (0.5, 1.0, 2.0, 4.0, 8.0)
FIRST_SHARES = (1.0, 3.0)
"""Of σ_c/σ_w."""
NEEDED_GAIN = 6.0
"""In −2 ln L, for two more figures: Akaike's criterion asks for 4."""
COARSE, FINE = 2.0, math.sqrt(2.0)
_NOISE_LIMITS = (0.0005, 10.0)
_SHARE_LIMITS = (0.125, 16.0)
_STEPS = 5


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


@dataclass(frozen=True)
class _Found:
    score: float
    errors: ErrorModel


Builder = Callable[[ErrorModel], Sequence[LinearModel]]
"""Models of the stretches of a flight, under given noises."""

Step = Callable[[ErrorModel, float], ErrorModel | None]
"""One of the noises times a factor; None where that goes too far."""


def likeliest_errors(build: Builder, first: ErrorModel) -> ErrorModel:
    """The noises under which the measurements are most probable, from a white first guess."""

    def scored(errors: ErrorModel) -> _Found:
        models = build(errors)
        found = [smooth(model) for model in models]
        count = sum(model.measurements for model in models)
        scale = sum(one.cost for one in found) / count
        errors = errors.scaled(math.sqrt(scale))
        score = count * math.log(scale) + sum(one.log_determinant for one in found)
        return _Found(score + (math.log(errors.walk / USUAL_WALK) / WALK_SPREAD) ** 2, errors)

    def climbed(start: _Found, steps: Sequence[Step]) -> _Found:
        for step in steps:
            start = _climbed(start, step, scored)
        return start

    of_positions = [*_position_steps(first)]
    plain = climbed(scored(first), [*of_positions, _walk_step, *of_positions])
    correlated = min((scored(one) for one in _correlated(plain.errors)), key=lambda one: one.score)
    correlated = climbed(correlated, [_share_step, _walk_step, _time_step, *of_positions, _share_step, _walk_step])
    best = correlated if correlated.score < plain.score - NEEDED_GAIN else plain
    return _climbed(best, _walk_step, scored, FINE).errors


def _correlated(white: ErrorModel) -> Iterator[ErrorModel]:
    """A first look at errors that are correlated in time, with an inertial solution as it usually is."""
    for time in CORRELATION_TIMES_S:
        for share in FIRST_SHARES:
            yield replace(white, walk=USUAL_WALK, correlated=share * white.white, correlation_time_s=time)


def _climbed(start: _Found, step: Step, scored: Callable[[ErrorModel], _Found], factor: float = COARSE) -> _Found:
    """Follow one noise up or down by a factor while that makes the measurements more probable."""
    best = start
    for direction in (factor, 1.0 / factor):
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
    return replace(errors, walk=walk) if _within(walk, _NOISE_LIMITS) else None


def _share_step(errors: ErrorModel, factor: float) -> ErrorModel | None:
    ratio = errors.correlated * factor / errors.white
    return replace(errors, correlated=errors.correlated * factor) if _within(ratio, _SHARE_LIMITS) else None


def _time_step(errors: ErrorModel, factor: float) -> ErrorModel | None:
    time = errors.correlation_time_s * factor
    limits = CORRELATION_TIMES_S[0], CORRELATION_TIMES_S[-1]
    return replace(errors, correlation_time_s=time) if _within(time, limits) else None


def _position_steps(errors: ErrorModel) -> Iterator[Step]:
    for number in range(len(errors.positions)):
        yield partial(_position_step, number, "white")
        yield partial(_position_step, number, "walk")


def _position_step(number: int, noise: str, errors: ErrorModel, factor: float) -> ErrorModel | None:
    old = errors.positions[number]
    new = replace(old, **{noise: getattr(old, noise) * factor})
    if not (_within(new.white, _NOISE_LIMITS) and _within(new.walk, _NOISE_LIMITS)):
        return None
    return replace(errors, positions=(*errors.positions[:number], new, *errors.positions[number + 1 :]))


def _within(value: float, limits: tuple[float, float]) -> bool:
    return limits[0] <= value <= limits[1]
