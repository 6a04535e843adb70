"""What the tuners of single effects tell of the flight: a cause that is one of these effects tells their values.

They cost more than signs do, so one is asked where a sign speaks, once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from fusetune.analyze.effects.airspeed import estimate_airspeed_scale
from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.flow import estimate_flow
from fusetune.analyze.effects.ground_effect import estimate_ground_effect
from fusetune.analyze.effects.magnetic import estimate_magnetic
from fusetune.analyze.effects.static_pressure import estimate_static_pressure
from fusetune.analyze.effects.vision import estimate_vision_arm
from fusetune.analyze.observed.observed_flight import ObservedFlight

TUNERS: Mapping[str, Callable[[ObservedFlight], tuple[Effect, ...]]] = {
    "static_pressure": lambda observed: (estimate_static_pressure(observed),),
    "ground_effect": lambda observed: (estimate_ground_effect(observed),),
    "magnetometer": estimate_magnetic,
    "airspeed": lambda observed: (estimate_airspeed_scale(observed),),
    "flow": lambda observed: (estimate_flow(observed),),
    "vision": lambda observed: (estimate_vision_arm(observed),),
}
"""Tuner → what it tells; that of the magnetometer tells several effects out of one fit."""

EFFECTS: Mapping[str, tuple[str, ...]] = {
    "static_pressure": ("static_pressure",),
    "ground_effect": ("ground_effect",),
    "magnetometer": ("motor_magnetic_field", "hard_iron", "magnetometer_scale", "declination"),
    "airspeed": ("airspeed_scale",),
    "flow": ("optical_flow",),
    "vision": ("vision_lever_arm",),
}
"""Tuner → ids of the effects that it tells."""


class ToldEffects:
    """Estimates of one flight by their names, as `EKF2_PCOEF_XP`; empty where there is no replay or none is told.

    Parameters
    ----------
    known : effects that tuners told of this flight already, and are not asked again
    """

    def __init__(self, observed: ObservedFlight | None, known: Sequence[Effect] = ()) -> None:
        self._observed, self._known = observed, {one.id: one for one in known}
        self._asked: dict[str, dict[str, Estimate]] = {}

    def __call__(self, tuner: str) -> Mapping[str, Estimate]:
        """What one of `TUNERS` tells, by name."""
        if self._observed is None:
            return {}
        if tuner not in self._asked:
            told = [self._known[one] for one in EFFECTS[tuner] if one in self._known]
            effects = told or TUNERS[tuner](self._observed)
            self._asked[tuner] = {one.name: one for effect in effects for one in effect.estimates}
        return self._asked[tuner]
