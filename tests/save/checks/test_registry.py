"""What the checks declare is what they do: topics and thresholds, found by taking all others away."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from tests.save.made_flight import judged, made_flight

from fusetune.check import Check
from fusetune.px4.flight import Flight
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.ulog.reader import read_ulog
from fusetune.save import checks
from fusetune.save.checks import registry
from fusetune.save.checks.judged_flight import JudgedFlight
from fusetune.save.thresholds import VerdictThresholds

NAMES = {one.name for one in fields(VerdictThresholds)}
IDS = [check.id for check in registry.CHECKS]


class Watched(VerdictThresholds):
    """Thresholds that note which of them are asked for."""

    def __getattribute__(self, name: str) -> object:
        if name in NAMES:
            object.__getattribute__(self, "__dict__").setdefault("asked", set()).add(name)
        return object.__getattribute__(self, name)


def spoiled_flights() -> Iterator[Flight]:
    """Flights with which every check warns, or fails, at least once."""
    yield made_flight()
    yield made_flight(rate_hz=20, seconds=5.0)
    nothing = made_flight()
    yield nothing.with_topics({("sensor_combined", 0): nothing.topics["sensor_combined", 0]})
    still = made_flight()
    for (topic, _), table in still.topics.items():
        for name, column in table.items():
            if topic != "vehicle_land_detected" and name.split("[")[0] not in ("timestamp", "landed", "fix_type"):
                column[:] = column[0]
    yield still
    unfixed = made_flight()
    unfixed.topics["vehicle_gps_position", 0]["fix_type"][:] = 1
    unfixed.topics["estimator_status_flags", 0] = {"timestamp": np.array([1]), "cs_ev_pos": np.array([True])}
    unfixed.parameters.initial |= {"EKF2_MAG_TYPE": 5, "EKF2_BARO_CTRL": 0, "EKF2_EV_CTRL": 15, "SDLOG_PROFILE": 1}
    yield unfixed
    selector = {"timestamp": np.array([20_000_000, 30_000_000]), "primary_instance": np.array([0, 1])}
    several = made_flight()
    yield several.with_topics(several.topics | {("estimator_selector_status", 0): selector})


@pytest.fixture(scope="module")
def flights() -> list[Flight]:
    return [canonical(flight) for flight in spoiled_flights()]


@pytest.mark.parametrize("check", registry.CHECKS, ids=IDS)
def test_a_check_reads_no_topics_but_those_that_it_declares(check: Check[JudgedFlight], flights: list[Flight]) -> None:
    for flight in flights:
        declared = {key: table for key, table in flight.topics.items() if key[0] in check.topics}
        whole = check.findings(JudgedFlight(flight, VerdictThresholds()))
        assert check.findings(JudgedFlight(flight.with_topics(declared), VerdictThresholds())) == whole


@pytest.mark.parametrize("check", registry.CHECKS, ids=IDS)
def test_a_check_uses_the_thresholds_that_it_declares_and_no_others(
    check: Check[JudgedFlight], flights: list[Flight]
) -> None:
    asked: set[str] = set()
    for flight in flights:
        limits = Watched()
        check.findings(JudgedFlight(flight, limits))
        asked |= vars(limits).get("asked", set())
    assert asked == set(check.thresholds)


def test_every_check_that_is_declared_is_listed() -> None:
    names = [found.name for found in pkgutil.iter_modules(checks.__path__, f"{checks.__name__}.")]
    declared = [one for name in names for one in vars(importlib.import_module(name)).values() if isinstance(one, Check)]
    assert {check.id for check in declared} == set(IDS)


def test_every_threshold_is_of_some_check() -> None:
    assert {name for check in registry.CHECKS for name in check.thresholds} == NAMES


def test_checks_have_names_of_their_own_and_say_what_they_look_at() -> None:
    assert len(set(IDS)) == len(IDS)
    assert all(check.looks_at.endswith(".") for check in registry.CHECKS)


def test_a_sound_flight_is_asked_everything_in_the_order_of_the_list() -> None:
    assert [finding.id for finding in judged(made_flight()).findings] == IDS


def test_without_imu_samples_nothing_but_the_log_is_judged() -> None:
    flight = made_flight()
    del flight.topics["sensor_combined", 0]
    asked = [finding.id for finding in judged(flight).findings]
    assert asked == [check.id for check in (*registry.OF_THE_LOG, registry.NEEDED)]


def test_after_a_failed_check_of_the_imu_its_others_are_left_out() -> None:
    findings = judged(made_flight(), replace(VerdictThresholds(), min_imu_duration_s=120.0)).findings
    asked = [finding.id for finding in findings]
    left_out = {check.id for check in registry.OF_THE_IMU} - set(asked)
    assert left_out == {
        check.id for check in registry.OF_THE_IMU[registry.OF_THE_IMU.index(_named("imu_duration")) + 1 :]
    }
    assert asked[-len(registry.OF_THE_FLIGHT) :] == [check.id for check in registry.OF_THE_FLIGHT]


def _named(name: str) -> Check[JudgedFlight]:
    return next(check for check in registry.CHECKS if check.id == name)


def test_real_logs_are_judged_by_the_declared_topics_alone(shared_logs: Path) -> None:
    for stem in (
        "PX4__sample_multi_ekf_default_params",
        "synthetic__mc_vision",
        "synthetic__fw_airspeed",
        "synthetic__mc_range",
    ):
        flight = canonical(read_ulog(shared_logs / f"{stem}.ulg"))
        for check in registry.CHECKS:
            declared = {key: table for key, table in flight.topics.items() if key[0] in check.topics}
            whole = check.findings(JudgedFlight(flight, VerdictThresholds()))
            assert check.findings(JudgedFlight(flight.with_topics(declared), VerdictThresholds())) == whole, check.id
