"""What flights cannot tell by how they moved."""

from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from tests.apply.statistics.test_leave_one_out import flight as evidence_of

from fusetune.analyze.delays.wrong_delays import JoinedDelay
from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.joined_effects import join_effects
from fusetune.apply.evidence import AnalyzedFlight
from fusetune.apply.missing_motion import missing_motion
from fusetune.apply.missing_motion_kinds import DELAYS, LEVER_ARMS, MINUTES, NOISES, THINNED

BRISK = {
    "seconds": 70.0, "horizontal_acceleration_m_s2": 3.7, "vertical_acceleration_m_s2": 1.0,
    "roll_pitch_rate_deg_s": 24.0, "yaw_rate_deg_s": 45.0, "turned_deg": 2400.0, "climbed_m": 70.0, "hover_share": 0.05,
}  # fmt: skip
"""An aggressive flight of the second simulator, as measured."""

HOVER = BRISK | {
    "horizontal_acceleration_m_s2": 0.24, "roll_pitch_rate_deg_s": 3.0, "yaw_rate_deg_s": 2.0, "hover_share": 0.93,
}  # fmt: skip
"""A hovering one: 93 % of the time slower than half a metre a second."""


def analyzed(moved: dict[str, float] | None, gnss_hz: float = 5.0, **changes: Any) -> AnalyzedFlight:
    samples = {"gnss_vel": {"mask": round(70.0 * gnss_hz)}}
    sets = {"present": {"evidence": {"samples": samples}}}
    summary = {"excitation": moved, "scored_s": 70.0, "sets": sets}
    evidence = evidence_of("f", [0.0, -0.1])
    return AnalyzedFlight("f", Path("f"), summary, pa.table({}), changes.get("evidence", evidence))


def kinds(*flights: AnalyzedFlight, delays: tuple[JoinedDelay, ...] = ()) -> list[str]:
    return [one.kind for one in missing_motion(flights, "present", delays)]


def delay(half_ms: float) -> JoinedDelay:
    return JoinedDelay(
        "gnss", "EKF2_GPS_DELAY", 110.0, 110.0, 110.0 - half_ms, 110.0 + half_ms, ("a", "b"), None, 200.0
    )


def test_aggressive_flights_miss_nothing() -> None:
    assert kinds(*[analyzed(BRISK)] * 3) == []


def test_hovering_tells_no_delay_and_only_its_own_noises() -> None:
    first, *rest = missing_motion([analyzed(HOVER)] * 4, "present")
    assert first.kind == DELAYS
    assert first.cannot == "Hover only: delays cannot be told, and noises found here are those of hovering"
    assert first.fly == "three hard accelerate–stop legs of 5 s each way"
    assert [one.kind for one in rest] == [LEVER_ARMS]


@pytest.mark.parametrize(("half_m", "missing"), [(0.03, []), (0.2, [LEVER_ARMS])])
def test_an_antenna_that_is_known_needs_no_turns(half_m: float, missing: list[str]) -> None:
    axes = tuple(Estimate(f"EKF2_GPS_POS_{axis}", "m", 0.0, 0.0, -half_m, half_m, half_m, 9) for axis in "XYZ")
    told = join_effects({"a": [Effect("gnss_antenna", axes)]})
    gentle = BRISK | {"roll_pitch_rate_deg_s": 5.0, "yaw_rate_deg_s": 5.0}
    assert [one.kind for one in missing_motion([analyzed(gentle)] * 3, "present", (), told)] == missing


def test_one_brisk_flight_is_not_enough_to_tell_a_delay_two_are() -> None:
    gentle = BRISK | {"horizontal_acceleration_m_s2": 0.8}
    assert kinds(analyzed(BRISK), *[analyzed(gentle)] * 3) == [DELAYS]
    assert kinds(analyzed(BRISK), analyzed(BRISK), analyzed(gentle)) == []


@pytest.mark.parametrize(("half_ms", "expected"), [(14.0, [NOISES, LEVER_ARMS]), (30.0, [DELAYS, LEVER_ARMS])])
def test_a_delay_that_is_sure_asks_for_no_flight(half_ms: float, expected: list[str]) -> None:
    assert kinds(*[analyzed(HOVER)] * 3, delays=(delay(half_ms),)) == expected


def test_thinned_logs_and_short_flights_are_told() -> None:
    assert kinds(*[analyzed(BRISK, gnss_hz=2.0)] * 3) == [THINNED]
    assert kinds(*[analyzed(BRISK | {"seconds": 20.0})] * 3) == [MINUTES]


def test_flights_without_a_say_or_without_figures_tell_nothing() -> None:
    assert kinds(analyzed(HOVER, evidence=None)) == []
    assert kinds(analyzed(None)) == []
