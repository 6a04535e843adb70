"""Time constants of the output predictor from made tracking errors."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fusetune.analyze.effects.output_predictor import estimate_output_predictor
from fusetune.px4.flight import Flight

TIME = np.arange(0, 80_000_000, 200_000)


def observed(velocity_error: float, position_error: float) -> Any:
    """What the tuner reads of a flight."""
    noise = 1.0 + 0.05 * np.sin(np.arange(TIME.size))
    errors = (np.full(TIME.size, 1e-3), velocity_error * noise, position_error * noise)
    table = {"timestamp": TIME, **{f"output_tracking_error[{one}]": value for one, value in enumerate(errors)}}
    flight = Flight("made", {("estimator_status", 0): table})
    parameters = {"EKF2_TAU_VEL": 0.25, "EKF2_TAU_POS": 0.25}
    return SimpleNamespace(flight=flight, logged=flight, parameters=parameters, clear_of_ground=((0, 80_000_000),))


def test_an_error_twice_of_what_is_warned_of_halves_the_constant() -> None:
    """A first-order lag: 0.1 m/s at 0.25 s is 0.05 m/s at 0.125 s; 0.1 m is below 0.15 m."""
    values = estimate_output_predictor(observed(0.1, 0.1)).values()
    assert values["EKF2_TAU_VEL"] == pytest.approx(0.125, rel=0.02)
    assert values["EKF2_TAU_POS"] == 0.25


def test_no_constant_is_shorter_than_ekf2_takes() -> None:
    assert estimate_output_predictor(observed(5.0, 5.0)).values()["EKF2_TAU_POS"] == 0.1


def test_a_log_without_the_error_is_refused() -> None:
    flight = Flight("made")
    effect = estimate_output_predictor(SimpleNamespace(flight=flight, logged=flight))  # type: ignore[arg-type]
    assert not effect.estimates
    assert "output_tracking_error" in effect.refusal
