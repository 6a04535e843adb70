"""All tuners of single effects on one flight; what several need is made once."""

from __future__ import annotations

from fusetune.analyze.effects.airspeed import estimate_airspeed_scale
from fusetune.analyze.effects.drag import estimate_drag, fit_drag
from fusetune.analyze.effects.estimate import Effect
from fusetune.analyze.effects.flow import estimate_flow
from fusetune.analyze.effects.gnss_antenna import estimate_gnss_antenna
from fusetune.analyze.effects.ground_effect import estimate_ground_effect
from fusetune.analyze.effects.imu_arm import estimate_imu_arm
from fusetune.analyze.effects.magnetic import estimate_magnetic
from fusetune.analyze.effects.output_predictor import estimate_output_predictor
from fusetune.analyze.effects.range_finder import estimate_range_arm, estimate_range_noise, fit_range
from fusetune.analyze.effects.static_pressure import estimate_static_pressure
from fusetune.analyze.effects.vision import estimate_vision_arm
from fusetune.analyze.observed.observed_flight import ObservedFlight


def all_effects(observed: ObservedFlight) -> tuple[Effect, ...]:
    """Every effect, told or refused, in the order of the documentation."""
    drag, ranged = fit_drag(observed), fit_range(observed)
    return (
        estimate_drag(observed, drag),
        estimate_static_pressure(observed, drag),
        estimate_ground_effect(observed),
        *estimate_magnetic(observed),
        estimate_gnss_antenna(observed),
        estimate_range_arm(observed, ranged),
        estimate_range_noise(observed, ranged),
        estimate_flow(observed),
        estimate_vision_arm(observed),
        estimate_airspeed_scale(observed, drag),
        estimate_output_predictor(observed),
        estimate_imu_arm(observed),
    )
