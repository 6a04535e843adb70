"""What is said against a change."""

import math

from tests.apply.test_choice import one

from fusetune.apply.cautions import cautions
from fusetune.apply.parameter_changes import ParameterChange
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.statistics.mean_difference import MeanDifference

SETTINGS = DecisionSettings()
WHITENESS = {"gnss_vel": 0.95, "gnss_pos": 0.02, "gnss_hgt": 0.1, "baro_hgt": 0.4, "mag": 0.9}


def change(name: str, previous: float, value: float) -> ParameterChange:
    return ParameterChange(name, previous, value, "FLOAT", "m", False)


def said(*changes: ParameterChange, aims: dict[str, MeanDifference] | None = None) -> str:
    return " ".join(cautions(one("b", -0.1, -0.05, aims=aims or {}), changes, WHITENESS, SETTINGS))


def test_a_kind_of_prediction_that_gets_worse_is_said_proved_or_not() -> None:
    worse = {"aided": MeanDifference(math.log(1.06), -0.1, 0.3, 6), "unaided": MeanDifference(-0.2, -0.3, -0.1, 6)}
    assert "Mind that one step ahead, with all sensors in use, its errors are 6.0 % larger than now." in said(
        aims=worse
    )
    assert "Mind" not in said(aims={"aided": MeanDifference(0.009, 0.001, 0.1, 6)})


def test_a_source_that_wanders_is_not_trusted_more_unsaid() -> None:
    text = said(change("EKF2_BARO_NOISE", 3.5, 1.5))
    assert "trusts barometer height more (EKF2_BARO_NOISE 3.5 → 1.5)" in text
    assert "its height may follow them" in text
    both = said(change("EKF2_GPS_P_NOISE", 0.5, 0.2))
    assert "its position may follow them" in both
    assert "its height may follow them" in both


def test_less_trust_or_trust_in_a_white_source_is_no_cause() -> None:
    for one_change in (change("EKF2_BARO_NOISE", 3.5, 7.0), change("EKF2_MAG_NOISE", 0.05, 0.01),
                       change("EKF2_ACC_NOISE", 0.35, 0.1)):  # fmt: skip
        assert said(one_change) == "Attitude and heading are judged only by what they do to velocity and position."


def test_what_turns_the_attitude_more_readily_is_said() -> None:
    assert "Mind its attitude (EKF2_GPS_V_NOISE 0.3 → 0.1)" in said(change("EKF2_GPS_V_NOISE", 0.3, 0.1))
    assert "Mind its attitude (EKF2_GYR_NOISE 0.015 → 0.005)" in said(change("EKF2_GYR_NOISE", 0.015, 0.005))
    assert "Mind its attitude" not in said(change("EKF2_GPS_V_NOISE", 0.3, 0.6))
