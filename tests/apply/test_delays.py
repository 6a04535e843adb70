"""What a pilot is told of delays."""

import pytest

from fusetune.analyze.delays.wrong_delays import JoinedDelay
from fusetune.apply.delays import SINGLE, WRONG, delay_findings, delay_sentences


def joined(value: float, mended: float | None, flights: tuple[str, ...] = ("a", "b", "c")) -> JoinedDelay:
    return JoinedDelay("gnss", "EKF2_GPS_DELAY", 110.0, value, value - 7.0, value + 7.0, flights, mended)


def test_a_wrong_delay_is_told_with_the_value_to_set() -> None:
    (found,) = delay_findings([joined(195.0, 200.0)], {"EKF2_DELAY_MAX": 200.0})
    assert (found.id, found.severity, found.figure, found.threshold) == (WRONG, "warning", 195.0, 110.0)
    assert delay_sentences([found]) == (
        "GNSS arrives 195 ms after its measurement (95 % interval 188 to 202 ms), and PX4 is told EKF2_GPS_DELAY = "
        "110: set EKF2_GPS_DELAY to 200."
    )


def test_a_delay_beyond_the_buffers_asks_for_longer_ones() -> None:
    (found,) = delay_findings([joined(231.0, 230.0)], {"EKF2_DELAY_MAX": 200.0})
    assert (
        found.remedy
        == "Set EKF2_GPS_DELAY to 230, and EKF2_DELAY_MAX, now 200, to as much, as EKF2 reaches no further back"
    )


def test_one_flight_alone_is_worth_a_note() -> None:
    (found,) = delay_findings([joined(205.0, None, ("a",))], {})
    assert (found.id, found.severity) == (SINGLE, "note")
    assert delay_sentences([found]) == ""


@pytest.mark.parametrize("one", [joined(112.0, None), joined(112.0, None, ("a",))])
def test_of_a_right_delay_nothing_is_said(one: JoinedDelay) -> None:
    assert delay_findings([one], {}) == ()
