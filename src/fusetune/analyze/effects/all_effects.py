"""All tuners of single effects on one flight; what several need is made once, and each is asked once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property

from fusetune.analyze.effects.airspeed import estimate_airspeed_scale
from fusetune.analyze.effects.drag import DragFit, estimate_drag, fit_drag
from fusetune.analyze.effects.estimate import Effect
from fusetune.analyze.effects.flow import estimate_flow
from fusetune.analyze.effects.gnss_antenna import estimate_gnss_antenna
from fusetune.analyze.effects.ground_effect import estimate_ground_effect
from fusetune.analyze.effects.imu_arm import estimate_imu_arm
from fusetune.analyze.effects.magnetic import estimate_magnetic
from fusetune.analyze.effects.output_predictor import estimate_output_predictor
from fusetune.analyze.effects.range_finder import RangeFit, estimate_range_arm, estimate_range_noise, fit_range
from fusetune.analyze.effects.static_pressure import estimate_static_pressure
from fusetune.analyze.effects.vision import estimate_vision_arm
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.storage.freed_memory import give_back_freed_memory


class FlightEffects:
    """Effects of one flight, each estimated when it is first asked for, once.

    Parameters
    ----------
    observed : the flight; it has to be replayable
    """

    def __init__(self, observed: ObservedFlight) -> None:
        self.observed = observed
        self._asked: dict[str, tuple[Effect, ...]] = {}

    @cached_property
    def drag(self) -> DragFit | str:
        """Drag and wind; a refusal in words where the flight does not tell them."""
        return fit_drag(self.observed)

    @cached_property
    def ranged(self) -> RangeFit | str:
        """Distances against the motion, likewise."""
        return fit_range(self.observed)

    def of(self, tuner: str) -> tuple[Effect, ...]:
        """What one of `TUNERS` tells."""
        if tuner not in self._asked:
            self._asked[tuner] = TUNERS[tuner](self)
            give_back_freed_memory()
        return self._asked[tuner]

    def all(self) -> tuple[Effect, ...]:
        """Every effect, told or refused, in the order of the documentation."""
        return tuple(effect for tuner in TUNERS for effect in self.of(tuner))


TUNERS: Mapping[str, Callable[[FlightEffects], tuple[Effect, ...]]] = {
    "drag": lambda one: (estimate_drag(one.observed, one.drag),),
    "static_pressure": lambda one: (estimate_static_pressure(one.observed, one.drag),),
    "ground_effect": lambda one: (estimate_ground_effect(one.observed),),
    "magnetometer": lambda one: estimate_magnetic(one.observed),
    "gnss_antenna": lambda one: (estimate_gnss_antenna(one.observed),),
    "range": lambda one: (
        estimate_range_arm(one.observed, one.ranged),
        estimate_range_noise(one.observed, one.ranged),
    ),
    "flow": lambda one: estimate_flow(one.observed),
    "vision": lambda one: (estimate_vision_arm(one.observed),),
    "airspeed": lambda one: (estimate_airspeed_scale(one.observed, one.drag),),
    "output_predictor": lambda one: (estimate_output_predictor(one.observed),),
    "imu_arm": lambda one: (estimate_imu_arm(one.observed),),
}
"""Tuner → what it tells; some tell several effects out of one fit."""


def all_effects(observed: ObservedFlight) -> tuple[Effect, ...]:
    """Every effect of a flight, told or refused, in the order of the documentation."""
    return FlightEffects(observed).all()
