"""Trials of a study: what the sets vary, and how they did."""

from dataclasses import replace

import numpy as np
import pytest
from tests.apply.test_ranking import analyzed

from fusetune.apply.evidence import AIDED, UNAIDED, AnalyzedFlight
from fusetune.apply.study_trials import trials_of_study

NOW = {"EKF2_ACC_NOISE": 0.35, "EKF2_GPS_DELAY": 110.0, "EKF2_GPS_V_NOISE": 0.3, "EKF2_HGT_REF": 1}
OVERRIDES = {
    "a": {},
    "b": {"EKF2_ACC_NOISE": 0.7},
    "c": {"EKF2_GPS_DELAY": 200.0, "EKF2_ACC_NOISE": 0.35},
    "d": {"EKF2_GPS_V_NOISE": 0.1, "EKF2_HGT_REF": 0},
}


def flight(number: int, scores: list[float], inactive: dict[str, str] | None = None) -> AnalyzedFlight:
    sets = {name: {"overrides": overrides, "parameters": NOW | overrides} for name, overrides in OVERRIDES.items()}
    sets["d"]["inactive"] = inactive or {}
    return replace(analyzed(number, scores), summary={"sets": sets})


def test_factors_are_what_the_sets_change_on_a_scale() -> None:
    flights = [flight(0, [0.0, -0.1, 0.2, 0.3]), flight(1, [1.0, 0.8, 1.1])]
    trials = trials_of_study(flights, flights[1], "a", ["c"])
    assert trials is not None
    acc, delay, gnss = trials.factors
    assert (acc.parameter, acc.scale, acc.low, acc.high, acc.origin) == ("EKF2_ACC_NOISE", "log", 0.35, 0.7, 0.35)
    assert (delay.parameter, delay.scale, delay.unit_step) == ("EKF2_GPS_DELAY", "linear", 90.0)
    assert (gnss.parameter, gnss.bounds) == ("EKF2_GPS_V_NOISE", (pytest.approx(np.log2(1.0 / 3.0)), 0.0))
    assert trials.coordinates == pytest.approx(
        np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, np.log2(1.0 / 3.0)]])
    )
    # a set that a flight lacks has no score there
    expected = np.array([[0.0, 0.0], [-0.1, -0.2], [0.2, 0.1], [0.3, np.nan]])
    assert trials.differences == pytest.approx(expected, nan_ok=True)
    assert trials.aims[AIDED] == pytest.approx(expected, nan_ok=True)
    assert np.isnan(trials.aims[UNAIDED]).all()
    assert trials.allowed.tolist() == [[True, True], [True, True], [False, False], [True, True]]


def test_what_never_acts_is_no_factor() -> None:
    scores = [0.0, -0.1, 0.2, 0.0]
    why = {"EKF2_GPS_V_NOISE": "below what the receiver reports"}
    never = [flight(0, scores, why), flight(1, scores, why)]
    once = [flight(0, scores, why), flight(1, scores)]
    for flights, names in (
        (never, NOW.keys() - {"EKF2_GPS_V_NOISE", "EKF2_HGT_REF"}),
        (once, NOW.keys() - {"EKF2_HGT_REF"}),
    ):
        trials = trials_of_study(flights, flights[0], "a")
        assert trials is not None
        assert set(trials.parameters) == names


def test_nothing_varied_or_no_evidence_is_no_trial() -> None:
    alone = replace(flight(0, [0.0]), summary={"sets": {"a": {"overrides": {}, "parameters": NOW}}})
    assert trials_of_study([alone], alone, "a") is None
    assert trials_of_study([replace(alone, evidence=None)], alone, "a") is None
    assert trials_of_study([], None, "a") is None
