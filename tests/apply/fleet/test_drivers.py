"""Flights that a verdict hangs on."""

from __future__ import annotations

import numpy as np

from fusetune.apply.fleet.drivers import fleet_verdict
from fusetune.apply.fleet.flights import SEVERITIES

NAMES = [f"flight_{place}" for place in range(6)]


def places(*severities: str) -> np.ndarray:
    return np.array([SEVERITIES.index(one) for one in severities], dtype=np.int8)


def test_the_only_failure_drives_the_worst() -> None:
    values = np.array([0.0, 0.1, 0.2, 0.1, 9.0, 0.0])
    judged = fleet_verdict(NAMES, values, places("pass", "pass", "pass", "pass", "fail", "pass"))
    assert (judged.worst, judged.typical, judged.flights) == ("fail", "pass", 6)
    assert judged.counts == {"pass": 5, "fail": 1}
    (driver,) = judged.drivers
    assert (driver.flight, driver.worst, driver.typical) == ("flight_4", "pass", "pass")
    # of 0, 0.1, 0.2, 0.1, 0
    assert (driver.mean, driver.median) == (np.mean([0.0, 0.1, 0.2, 0.1, 0.0]), 0.1)


def test_two_failures_drive_nothing_alone() -> None:
    values = np.array([1.0, 2.0, 3.0, 2.0, 2.5, 1.5])
    judged = fleet_verdict(NAMES, values, places("fail", "pass", "pass", "pass", "fail", "pass"))
    assert judged.worst == "fail"
    assert judged.drivers == ()


def test_what_half_of_the_flights_reach_is_typical() -> None:
    judged = fleet_verdict(NAMES[:4], np.ones(4), places("pass", "warning", "pass", "warning"))
    assert judged.typical == "warning"
    # without one that warns, two of three pass
    assert [one.flight for one in judged.drivers] == ["flight_1", "flight_3"]
    assert {one.typical for one in judged.drivers} == {"pass"}


def test_a_flight_that_moves_the_mean_beyond_what_is_known_of_it_is_named() -> None:
    """The others' mean is 0 ± 1/√5·s; (30 − 0)/6 = 5 is more."""
    values = np.array([-1.0, 1.0, 0.0, -1.0, 1.0, 30.0])
    judged = fleet_verdict(NAMES, values, places(*["pass"] * 6))
    assert [one.flight for one in judged.drivers] == ["flight_5"]
    assert judged.drivers[0].mean == 0.0


def test_flights_without_the_figure_do_not_count() -> None:
    severities = places("does-not-apply", "fail", "does-not-apply", "pass", "does-not-apply", "does-not-apply")
    judged = fleet_verdict(NAMES, np.full(6, np.nan), severities)
    assert (judged.flights, judged.worst, judged.typical) == (2, "fail", "fail")
    alone = fleet_verdict(NAMES[:2], np.array([np.nan, 3.0]), severities[:2])
    (driver,) = alone.drivers
    assert (driver.worst, driver.mean) == ("does-not-apply", None)
