"""The health table of whole flights: healthy ones, faulty ones, those of every release, and those that lack topics."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.analyze.health.old_flights import (
    ACCEL_BIAS,
    ACCEL_VIBRATION,
    GYRO_BIAS,
    GYRO_VIBRATION,
    STATUS_RATIO,
    VELOCITY_ERROR,
    old_flight,
)
from tests.save.test_old_and_new_logs import SECONDS

from fusetune.analyze.health.health_table import health_rows
from fusetune.analyze.health.settings import HealthSettings
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.px4.flight import Flight
from fusetune.px4.releases import DEVELOPMENT, READ, name_of
from fusetune.px4.ulog.reader import read_ulog

HEALTHY = [*(f"SkyRats__log_{number}_" for number in (7, 8, 9, 10, 13, 16, 17)), "JAParedes", "Parham"]


@pytest.mark.parametrize("name", HEALTHY)
def test_a_healthy_flight_has_no_failure(told, name):
    health = told(name)
    assert not health.ids("fail")
    # on every one there is something to be judged of each kind
    assert {"gnss_vel_horizontal.raised_share", "mag.raised_share", "filter.faults", "bias.gyro"} <= health.ids("pass")
    assert {"gnss.eph", "output_predictor.velocity_error_m_s", "imu.rate_hz"} <= health.ids("pass")


@pytest.mark.parametrize(
    ("name", "failures"),
    [
        ("PX4__ekf_failure", {"filter.faults", "clipping.accel"}),
        ("SkyRats__log_28", {"mag_heading.rejected_share", "rejections.yaw_share"}),
        ("SkyRats__log_29", {"mag.raised_share", "rejections.yaw_share", "filter.faults"}),
        ("Chainplain", {"clipping.accel", "rejections.ver_vel_share", "aiding.longest_unaided_s"}),
        ("Auterion__quadrotor_local", {"gnss.fix_type"}),
    ],
)
def test_a_faulty_flight_fails_by_what_the_list_of_logs_says_of_it(told, name, failures):
    assert failures <= told(name).ids("fail")


@pytest.mark.parametrize(
    "name", ["SkyRats__log_8", "Chainplain", "PX4__sample_multi", "pypi__sample", "synthetic__mc_gnss."]
)
def test_no_two_rows_are_about_the_same(told, name):
    keys = [(row.finding.id, row.instance, row.origin) for row in told(name).rows]
    assert len(keys) == len(set(keys)) > 20


def test_what_the_log_lacks_comes_from_the_replay_and_says_so(told):
    health = told("synthetic__mc_gnss.")
    origins = {row.finding.id: row.origin for row in health.rows}
    for name in (
        "gnss_vel_horizontal.raised_share",
        "mag.raised_share",
        "filter.faults",
        "bias.gyro",
        "alignment.yaw_s",
    ):
        assert origins[name] == "replay"
    assert origins["gnss.eph"] == origins["imu.rate_hz"] == "vehicle"
    # what estimates the biases flew with none of either
    assert health.row("bias.gyro", origin="replay").finding.figure < 0.02
    assert not health.ids("fail")


@pytest.mark.parametrize("release", [*READ, DEVELOPMENT], ids=name_of)
def test_the_same_flight_has_the_same_figures_in_the_layout_of_every_release(release):
    # of twelve seconds one lies clear of the ground
    rows = health_rows(ObservedFlight(old_flight(release)), HealthSettings(min_flight_s=0.5))
    health = {(row.finding.id, row.origin): row.finding for row in rows}

    def figure(name: str) -> float:
        return health[name, "vehicle"].figure

    assert figure("bias.gyro") == pytest.approx(np.linalg.norm(GYRO_BIAS), rel=1e-4)
    assert figure("bias.accel") == pytest.approx(np.linalg.norm(ACCEL_BIAS), rel=1e-4)
    assert figure("vibration.accel_mean") == pytest.approx(ACCEL_VIBRATION, rel=1e-4)
    assert figure("vibration.gyro_peak") == pytest.approx(GYRO_VIBRATION, rel=1e-4)
    assert figure("output_predictor.velocity_error_m_s") == pytest.approx(VELOCITY_ERROR, rel=1e-4)
    # innovation² / (gate² × variance), with a gate of five standard deviations
    assert figure("gnss_vel_horizontal.mean_ratio") == pytest.approx(0.5**2 / (25 * 0.04), rel=1e-3)
    assert figure("status_velocity.mean_ratio") == pytest.approx(STATUS_RATIO, rel=1e-4)
    assert figure("rejections.hor_pos_share") == 1.0
    assert figure("rejections.ver_pos_share") == figure("rejections.yaw_share") == 0.0
    assert figure("gnss.eph") == pytest.approx(0.8)
    assert figure("imu.rate_hz") == pytest.approx(200.0)
    assert figure("flight.airborne_s") == pytest.approx(SECONDS - 1.0, abs=0.1)
    # nothing of it had to be replayed
    assert {origin for _, origin in health} == {"vehicle"}


def test_a_log_of_nothing_applies_to_nothing():
    rows = health_rows(ObservedFlight(Flight("nothing")))
    told = {row.finding.id for row in rows if row.finding.severity != "does-not-apply"}
    assert told == {"instances.count", "receivers.count"}
    assert len(rows) > 15


@pytest.mark.parametrize(
    "lacking", ["estimator_status", "vehicle_land_detected", "vehicle_gps_position", "sensor_combined"]
)
def test_a_topic_that_is_missing_is_no_mistake(shared_logs: Path, lacking):
    (path,) = shared_logs.glob("SkyRats__log_10_*.ulg")
    logged = read_ulog(path)
    topics = {key: table for key, table in logged.topics.items() if key[0] != lacking}
    rows = health_rows(ObservedFlight(logged.with_topics(topics)))
    assert not [row for row in rows if row.finding.severity == "fail"]
    if lacking == "vehicle_land_detected":
        # the filter's own flag tells when it flew
        (airborne,) = (row.finding.figure for row in rows if row.finding.id == "flight.airborne_s")
        assert airborne == pytest.approx(21.9, abs=3.0)


@pytest.mark.parametrize(
    "topic",
    ["estimator_status", "estimator_status_flags", "vehicle_gps_position", "vehicle_imu_status", "sensor_combined"],
)
def test_a_column_that_is_missing_is_no_mistake(shared_logs: Path, topic):
    (path,) = shared_logs.glob("SkyRats__log_10_*.ulg")
    logged = read_ulog(path)
    table = logged.topics[topic, 0]
    for lacking in table.keys() - {"timestamp"}:
        rest = {name: values for name, values in table.items() if name != lacking}
        assert health_rows(ObservedFlight(logged.with_topics(logged.topics | {(topic, 0): rest}))), lacking


def test_topics_without_rows_are_no_mistake(shared_logs: Path):
    (path,) = shared_logs.glob("SkyRats__log_10_*.ulg")
    logged = read_ulog(path)
    empty = {key: {name: values[:0] for name, values in table.items()} for key, table in logged.topics.items()}
    assert not [row for row in health_rows(ObservedFlight(logged.with_topics(empty))) if row.finding.severity == "fail"]


def test_every_row_can_be_told(told):
    for row in told("Chainplain").rows:
        finding = row.finding
        assert finding.found
        assert finding.severity in ("does-not-apply", "pass", "warning", "fail")
        assert finding.figure is None or np.isfinite(finding.figure)
        if finding.severity in ("warning", "fail"):
            assert finding.remedy
            assert finding.threshold is not None
