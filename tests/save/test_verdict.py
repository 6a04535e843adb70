"""Which flights are refused, and why."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.save.made_flight import check_of, judged, made_flight

from fusetune.px4.flight import Flight
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.ulog.reader import read_ulog
from fusetune.save.log_facts import flight_times
from fusetune.save.thresholds import VerdictThresholds
from fusetune.save.verdict import judge

REFUSED = {
    "PX4__sample_log_small": r"too short: 6\.5 s of IMU",
    "YevheniiKovryzhenko__log_16_2024-8-8-11-32-18": r"IMU is logged at 20 Hz",
    "Auterion__quadrotor_local": r"not replayable with GNSS",
    "Auterion__corrupt_format_not_utf8": r"time in the log runs backwards 2 times",
}


def test_good_flight_passes_every_check() -> None:
    flight = made_flight()
    verdict = judged(flight)
    assert verdict.status == "replayable"
    assert {check.severity for check in verdict.findings} == {"pass"}, verdict.warnings
    assert check_of(flight, "imu_rate").figure == pytest.approx(200.0)
    # 600 rows of 20 Hz in the air
    assert check_of(flight, "airborne").figure == pytest.approx(30.0)


def test_missing_imu_is_refused() -> None:
    flight = made_flight()
    del flight.topics["sensor_combined", 0]
    verdict = judged(flight)
    assert verdict.status == "refused"
    assert "no IMU samples" in verdict.reasons[0]


@pytest.mark.parametrize("column", ["gyro_rad[1]", "accelerometer_integral_dt"])
def test_imu_that_lacks_a_field_is_refused(column: str) -> None:
    flight = made_flight()
    del flight.topics["sensor_combined", 0][column]
    assert column.split("[")[0] in judged(flight).reasons[0]


def test_slow_short_and_patchy_imu_are_refused_with_their_own_reason() -> None:
    assert "logged at 20 Hz" in judged(made_flight(rate_hz=20)).reasons[0]
    assert "too short: 5.0 s" in judged(made_flight(seconds=5.005)).reasons[0]
    patchy = made_flight()
    patchy.topics["sensor_combined", 0]["gyro_integral_dt"][:] = 1000
    assert judged(patchy).reasons == ("IMU samples cover 20% of the time (at least 50%)",)


def test_clock_that_runs_backwards_is_refused() -> None:
    flight = made_flight()
    flight.topics["sensor_combined", 0]["timestamp"][6000:] -= 20_000_000
    assert "runs backwards once (by up to 20 s)" in judged(flight).reasons[0]


def test_thresholds_come_from_the_configuration() -> None:
    strict = replace(VerdictThresholds(), min_imu_duration_s=120.0)
    assert judged(made_flight(), strict).status == "refused"


def without_fix() -> Flight:
    flight = made_flight()
    flight.topics["vehicle_gps_position", 0]["fix_type"][:] = 1
    return flight


def test_gnss_without_fix_is_refused_only_where_nothing_else_aids() -> None:
    assert "not replayable with GNSS" in judged(without_fix()).reasons[0]
    vision = without_fix()
    vision.parameters.initial["EKF2_EV_CTRL"] = 1
    time = vision.topics["vehicle_air_data", 0]["timestamp"]
    position = {f"position[{axis}]": np.ones(len(time), np.float32) for axis in range(3)}
    frame = {"pose_frame": np.ones(len(time), np.uint8)}
    vision.topics["vehicle_visual_odometry", 0] = {"timestamp": time, **frame, **position}
    assert judged(vision).status == "replayable"
    assert "external vision" in check_of(vision, "horizontal_aid").found
    flow = without_fix()
    pixels = {f"pixel_flow[{axis}]": np.zeros(len(time), np.float32) for axis in range(2)}
    pixels["integration_timespan_us"] = np.full(len(time), 50_000, np.uint32)
    pixels["quality"] = np.full(len(time), 200, np.uint8)
    flow.topics["vehicle_optical_flow", 0] = {"timestamp": time, **pixels}
    assert judged(flow).status == "replayable"


def test_aiding_that_the_log_does_not_hold_is_a_warning() -> None:
    flight = without_fix()
    flags = {"timestamp": np.array([2_000_000]), "cs_ev_pos": np.array([True])}
    flight.topics["estimator_status_flags", 0] = flags
    verdict = judged(flight)
    assert verdict.status == "replayable"
    assert any("external vision, whose samples the log lacks" in warning for warning in verdict.warnings)


def test_flight_without_gnss_switched_on_is_not_judged_by_gnss() -> None:
    flight = without_fix()
    flight.parameters.initial["EKF2_GPS_CTRL"] = 0
    assert check_of(flight, "gnss").severity == "does-not-apply"
    assert check_of(flight, "horizontal_aid").severity == "warning"


def test_height_needs_some_source() -> None:
    flight = made_flight()
    del flight.topics["vehicle_air_data", 0]
    assert check_of(flight, "barometer").severity == "warning"
    flight.parameters.initial["EKF2_GPS_CTRL"] = 5
    assert "nothing in the log measures the height" in judged(flight).reasons[0]


def test_magnetometer_may_be_missing_or_switched_off() -> None:
    flight = made_flight()
    del flight.topics["vehicle_magnetometer", 0]
    assert check_of(flight, "magnetometer").severity == "warning"
    flight.parameters.initial["EKF2_MAG_TYPE"] = 5
    assert check_of(flight, "magnetometer").severity == "does-not-apply"


def test_failures_and_warnings_name_a_remedy() -> None:
    for flight in (without_fix(), made_flight(rate_hz=20), made_flight(seconds=5.005)):
        for check in judged(flight).findings:
            assert check.remedy or check.severity in ("pass", "does-not-apply")


def test_verdicts_of_the_shared_logs(shared_logs: Path) -> None:
    for log in sorted(shared_logs.glob("*.ulg")):
        verdict = judge(canonical(read_ulog(log)))
        if log.stem in REFUSED:
            assert verdict.status == "refused", log.stem
            assert re.search(REFUSED[log.stem], verdict.reasons[0]), (log.stem, verdict.reasons)
        else:
            assert verdict.status == "replayable", (log.stem, verdict.reasons)


def test_airborne_time_agrees_with_the_table_of_the_shared_logs(shared_logs: Path) -> None:
    """Seconds as the README of the logs gives them (rounded)."""
    airborne = {
        "JAParedes__TestFlight1": 52,
        "FSYR-H__log_61_2024-2-6-16-27-02": 74,
        "PX4__ekf_failure": 74,
        "SkyRats__log_3_2021-5-23-14-32-52": 27,
        "mengchaoheng__test3": 33,
        "Auterion__quadrotor_local": 86,
        "PX4__sample_log_small": 1,
        "pypi__sample_appended": 0,
    }
    for name, seconds in airborne.items():
        found = flight_times(read_ulog(shared_logs / f"{name}.ulg")).airborne_s
        assert found == pytest.approx(seconds, abs=0.6), name
