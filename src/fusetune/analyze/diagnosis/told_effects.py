"""What the tuners of single effects tell of the flight: a cause that is one of these effects tells their values.

They cost more than signs do, so one is asked where a sign speaks, once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property

from fusetune.analyze.effects.airspeed import estimate_airspeed_scale
from fusetune.analyze.effects.drag import DragFit, fit_drag
from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.flow import estimate_flow
from fusetune.analyze.effects.ground_effect import estimate_ground_effect
from fusetune.analyze.effects.magnetic import estimate_magnetic
from fusetune.analyze.effects.static_pressure import estimate_static_pressure
from fusetune.analyze.effects.told import NO_MOTION
from fusetune.analyze.effects.vision import estimate_vision_arm
from fusetune.analyze.observed.observed_flight import ObservedFlight

Drag = DragFit | str
TUNERS: Mapping[str, Callable[[ObservedFlight, Callable[[], Drag]], tuple[Effect, ...]]] = {
    "static_pressure": lambda observed, drag: (estimate_static_pressure(observed, drag()),),
    "ground_effect": lambda observed, _: (estimate_ground_effect(observed),),
    "magnetometer": lambda observed, _: estimate_magnetic(observed),
    "airspeed": lambda observed, _: (estimate_airspeed_scale(observed),),
    "flow": lambda observed, _: (estimate_flow(observed),),
    "vision": lambda observed, _: (estimate_vision_arm(observed),),
}
"""Tuner → what it tells; that of the magnetometer tells several effects out of one fit."""


class ToldEffects:
    """Estimates of one flight by their names, as `EKF2_PCOEF_XP`; empty where there is no replay or none is told."""

    def __init__(self, observed: ObservedFlight | None) -> None:
        self._observed = observed
        self._asked: dict[str, tuple[Effect, ...]] = {}

    @cached_property
    def drag(self) -> Drag:
        """Drag and wind of the flight; in words why not, where it does not tell them."""
        return fit_drag(self._observed) if self._observed is not None else NO_MOTION

    def __call__(self, tuner: str) -> Mapping[str, Estimate]:
        """What one of `TUNERS` tells, by name."""
        return {one.name: one for effect in self._effects(tuner) for one in effect.estimates}

    def figures(self, tuner: str) -> Mapping[str, float]:
        """What its estimates rest on, by name."""
        return {name: value for effect in self._effects(tuner) for name, value in effect.figures.items()}

    def _effects(self, tuner: str) -> tuple[Effect, ...]:
        if self._observed is None:
            return ()
        if tuner not in self._asked:
            self._asked[tuner] = TUNERS[tuner](self._observed, lambda: self.drag)
        return self._asked[tuner]
