"""Effects of several flights: which become sets, by hand calculation."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusetune.analyze.effects.effect_files import effects_document, read_effects
from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.joined_effects import join_effects
from fusetune.storage.documents import write_document


def estimate(name: str, value: float, error: float, told: float | None = 0.0) -> Estimate:
    return Estimate(name, "m", told, value, value - 2.0 * error, value + 2.0 * error, error, 100)


def antenna(x: float, z: float = 0.0) -> Effect:
    return Effect("gnss_antenna", (estimate("EKF2_GPS_POS_X", x, 0.02), estimate("EKF2_GPS_POS_Z", z, 0.02)))


def test_what_flights_measure_beyond_doubt_otherwise_than_told_becomes_a_set() -> None:
    """Three flights, 0.02 m each: 0.0115 m times t(0.975; 2) = 4.30 is 0.05 m; −0.3 is beyond, 0.01 is not."""
    joined = join_effects({"a": [antenna(-0.301)], "b": [antenna(-0.304)], "c": [antenna(-0.3, 0.03)]})
    assert joined.sets == {"antenna_mended": {"EKF2_GPS_POS_X": pytest.approx(-0.302)}}
    assert joined.flights == {"gnss_antenna": ("a", "b", "c")}


def test_one_flight_is_not_enough_for_a_set() -> None:
    joined = join_effects({"a": [antenna(-0.3)], "b": [Effect("gnss_antenna", (), "flown too gently")]})
    assert joined.sets == {}
    assert joined.effects["gnss_antenna"]["EKF2_GPS_POS_X"].value == pytest.approx(-0.3)


def test_what_no_flight_tells_keeps_the_newest_refusal() -> None:
    joined = join_effects({"a": [Effect("drag", (), "old")], "b": [Effect("drag", (), "new")]})
    assert joined.refusals == {"drag": "new"}
    assert joined.sets == {}


def test_values_stay_within_the_limits_of_px4_and_what_the_filter_does_not_see_is_no_set() -> None:
    """EKF2_GND_EFF_DZ ends at 10 m; EKF2_TAU_VEL belongs to the output predictor."""
    ground = Effect("ground_effect", (estimate("EKF2_GND_EFF_DZ", 14.0, 0.1, 4.0),))
    predictor = Effect("output_predictor", (estimate("EKF2_TAU_VEL", 0.1, 0.001, 0.25),))
    joined = join_effects({name: [ground, predictor] for name in "abc"})
    assert joined.sets == {"ground_effect_mended": {"EKF2_GND_EFF_DZ": 10.0}}


def test_effects_are_read_as_they_were_written(tmp_path: Path) -> None:
    effects = [antenna(-0.3), Effect("drag", (), "flown too gently", {"wind_m_s": 2.0})]
    write_document(tmp_path / "effects.json", effects_document("a", effects))
    assert read_effects(tmp_path / "effects.json") == tuple(effects)
