"""Estimates out of a fit, and words that several tuners use."""

from __future__ import annotations

from collections.abc import Mapping

from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.walking_regression import WalkingFit

NO_MOTION = (
    "the replay gives no motion to compare with: the log needs `sensor_combined` at full rate and a filter that"
    " aligns; log with SDLOG_PROFILE bit 1 from boot"
)


def estimate_of(fit: WalkingFit, index: int, name: str, unit: str, told: float | None, factor: float = 1.0) -> Estimate:
    """A constant of a fit, times a factor, with its 95 % interval."""
    value, half = factor * float(fit.constants[index]), abs(factor) * fit.half_width(index)
    error = abs(factor) * float(fit.standard_error[index])
    return Estimate(name, unit, told, value, value - half, value + half, error, int(fit.residual.size))


def told_value(parameters: Mapping[str, object], name: str) -> float | None:
    """What a log tells of a parameter; None where it does not."""
    value = parameters.get(name)
    return float(value) if isinstance(value, int | float) else None


def refused(effect: str, why: str, **figures: float) -> Effect:
    """An effect that the flight does not tell."""
    return Effect(effect, (), why, figures)
