"""What the tuners of single effects tell of the flight: a cause that is one of these effects tells their values.

They cost more than signs do, so one is asked where a sign speaks.
"""

from __future__ import annotations

from collections.abc import Mapping

from fusetune.analyze.effects.all_effects import FlightEffects
from fusetune.analyze.effects.estimate import Estimate


class ToldEffects:
    """Estimates of one flight by their names, as `EKF2_PCOEF_XP`; empty where there is no replay or none is told."""

    def __init__(self, effects: FlightEffects | None) -> None:
        self._effects = effects

    def __call__(self, tuner: str) -> Mapping[str, Estimate]:
        """What one of `effects.all_effects.TUNERS` tells, by name."""
        if self._effects is None:
            return {}
        return {one.name: one for effect in self._effects.of(tuner) for one in effect.estimates}
