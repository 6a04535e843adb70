"""What each check finds, on a flight that is sound but for one thing."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from tests.save.made_flight import SLOW_HZ, check_of, judged, made_flight

from fusetune.px4.flight import Flight, LeftOut, ParameterChange, ParameterHistory
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.ulog.times import ANOTHER_CLOCK
from fusetune.save.checks import judged_flight
from fusetune.save.log_facts import is_airborne
from fusetune.save.replayed_release import replayed_release


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_single_impossible_samples_are_left_out_and_many_refuse_the_flight(value: float) -> None:
    flight = made_flight()
    gyro = flight.topics["sensor_combined", 0]["gyro_rad[0]"]
    gyro[5] = value
    check = check_of(flight, "sensor_values")
    assert check.severity == "warning"
    assert "1 message left out (1 of sensor_combined: impossible value)" in check.found
    assert len(canonical(flight).topics["sensor_combined", 0]["timestamp"]) == len(gyro) - 1
    gyro[:121] = value  # of 12000: just above the limit of 1 %
    assert "1.0% of the IMU samples have impossible values" in judged(flight).reasons[0]


@pytest.mark.parametrize(
    ("topic", "column", "value"),
    [
        ("vehicle_magnetometer", "magnetometer_ga[2]", 1e10),
        ("vehicle_air_data", "baro_alt_meter", np.nan),
        ("vehicle_gps_position", "eph", -1.0),
    ],
)
def test_impossible_samples_of_aiding_sensors_are_left_out(topic: str, column: str, value: float) -> None:
    flight = made_flight()
    flight.topics[topic, 0][column][7] = value
    assert f"1 of {topic}" in check_of(flight, "sensor_values").found
    assert judged(flight).status == "replayable"


def test_accuracies_without_a_fix_may_be_anything() -> None:
    flight = made_flight()
    gnss = flight.topics["vehicle_gps_position", 0]
    gnss["fix_type"][:10], gnss["eph"][:10] = 0, np.inf
    assert check_of(flight, "sensor_values").severity == "pass"


def test_sample_times_that_cannot_be_are_left_out() -> None:
    flight = made_flight()
    baro = flight.topics["vehicle_air_data", 0]
    baro["timestamp_sample"] = baro["timestamp"] - 2000
    baro["timestamp_sample"][3] += 1 << 40
    assert "1 of vehicle_air_data" in check_of(flight, "sensor_values").found


def test_default_profile_is_warned_of_with_the_settings_for_the_next_flight() -> None:
    flight = made_flight()
    del flight.topics["ekf2_timestamps", 0]
    flight.parameters.initial |= {"SDLOG_PROFILE": 1, "SDLOG_MODE": 0}
    for topic, step in (("vehicle_magnetometer", 10), ("vehicle_air_data", 4), ("vehicle_gps_position", 20)):
        flight.topics[topic, 0] = {name: values[::step] for name, values in flight.topics[topic, 0].items()}
    assert judged(flight).status == "replayable"
    for name, step in (("magnetometer", 10), ("barometer", 4), ("gnss", 20)):
        check = check_of(flight, name)
        assert (check.severity, check.figure) == ("warning", pytest.approx(SLOW_HZ / step))
    profile = check_of(flight, "logging_profile")
    assert profile.severity == "warning"
    assert "while armed (SDLOG_MODE = 0)" in profile.found
    for setting in ("SDLOG_PROFILE = 3", "SDLOG_MODE = 2", "EKF2_LOG_VERBOSE = 1"):
        assert setting in profile.remedy
    assert "EKF2_MULTI_IMU" not in profile.remedy
    flight.topics["estimator_status", 1] = flight.topics["estimator_status", 0]
    assert "EKF2_MULTI_IMU = 0 and EKF2_MULTI_MAG = 0" in check_of(flight, "logging_profile").remedy


@pytest.mark.parametrize(
    ("column", "name", "bad"),
    [
        ("eph", "gnss_position_accuracy", 3.5),
        ("epv", "gnss_height_accuracy", 6.0),
        ("s_variance_m_s", "gnss_speed_accuracy", 0.8),
    ],
)
def test_inaccurate_gnss(column: str, name: str, bad: float) -> None:
    flight = made_flight()
    assert check_of(flight, name).severity == "pass"
    flight.topics["vehicle_gps_position", 0][column][:] = bad
    check = check_of(flight, name)
    assert (check.severity, check.figure) == ("warning", pytest.approx(bad))


def test_gnss_without_a_fix_for_half_of_the_time() -> None:
    flight = made_flight()
    fix_type = flight.topics["vehicle_gps_position", 0]["fix_type"]
    fix_type[: len(fix_type) // 2] = 2
    check = check_of(flight, "gnss_fix")
    assert (check.severity, check.figure) == ("warning", pytest.approx(0.5))


def test_gaps_between_imu_samples() -> None:
    flight = made_flight()
    imu = flight.topics["sensor_combined", 0]
    flight.topics["sensor_combined", 0] = {name: np.delete(values, slice(1000, 1100)) for name, values in imu.items()}
    check = check_of(flight, "imu_gaps")
    assert (check.severity, check.figure, check.unit) == ("warning", pytest.approx(101 * 0.005), "s")
    # row 999 and the former row 1100, 5 ms apart each, the first at 1 s
    assert (check.start_us, check.stop_us, check.evidence) == (5_995_000, 6_500_000, {"gaps": 1})
    flight = made_flight(seconds=120.0)
    flight.topics["sensor_combined", 0]["timestamp"][12_000:] += 40_000_000
    assert "no IMU samples for 40 s" in judged(flight).reasons[0]


def test_clipping() -> None:
    flight = made_flight()
    clipping = np.zeros(12_000, np.uint8)
    clipping[:60] = 4
    flight.topics["sensor_combined", 0]["accelerometer_clipping"] = clipping
    check = check_of(flight, "imu_clipping")
    assert (check.severity, check.figure) == ("warning", pytest.approx(60 / 12_000))
    flight.info["ver_sw_release"] = 0x010A00FF  # v1.10 does not log it
    assert check_of(flight, "imu_clipping").severity == "does-not-apply"


@pytest.mark.parametrize(("lead_rows", "status"), [(20, "warning"), (100, "warning"), (240, "pass")])
def test_log_that_begins_shortly_before_take_off_is_replayable(lead_rows: int, status: str) -> None:
    """27 s of IMU samples, from 1, 5 and 12 s before take-off on."""
    flight = made_flight(seconds=27.0)
    slow = flight.topics["vehicle_air_data", 0]["timestamp"]
    flight.topics["vehicle_land_detected", 0] = {"timestamp": slow[[0, lead_rows]], "landed": np.array([True, False])}
    check = check_of(flight, "log_start")
    assert (check.severity, check.figure) == (status, pytest.approx(lead_rows / SLOW_HZ))
    assert judged(flight).status == "replayable"


def test_log_that_begins_in_the_air() -> None:
    flight = made_flight()
    flight.topics["vehicle_land_detected", 0]["landed"][0] = False
    assert check_of(flight, "log_start").found == "the log begins in the air"


def test_flight_without_land_detector() -> None:
    flight = made_flight()
    del flight.topics["vehicle_land_detected", 0]
    assert check_of(flight, "land_detector").severity == "warning"
    assert check_of(flight, "airborne").severity == check_of(flight, "log_start").severity == "does-not-apply"


def test_which_estimator_was_primary_when() -> None:
    flight = made_flight()
    for instance in range(1, 3):
        flight.topics["estimator_status", instance] = flight.topics["estimator_status", 0]
    primary = np.array([0, 2, 1], np.uint8)
    times = np.array([1_000_000, 20_000_000, 30_000_000])
    flight.topics["estimator_selector_status", 0] = {"timestamp": times, "primary_instance": primary}
    check = check_of(flight, "estimator_instances")
    # times count from the first IMU sample, which is at 1 s
    assert check.found == "3 estimators ran, primary: instance 0 first, 2 from 19.0 s on, 1 from 29.0 s on"
    assert (check.severity, check.figure) == ("warning", 2.0)
    primary[:] = 1
    assert check_of(flight, "estimator_instances").severity == "pass"


def test_imu_selection_counts_only_in_flight() -> None:
    flight = made_flight()
    selection = flight.topics["sensor_selection", 0]
    selection["timestamp"] = np.array([1_000_000, 31_000_000])
    assert check_of(flight, "imu_selection").severity == "pass"
    selection["accel_device_id"][1] = 2
    check = check_of(flight, "imu_selection")
    assert check.severity == "warning"
    assert "30.0 s" in check.found
    selection["timestamp"][1] = 5_000_000  # before take-off
    assert check_of(flight, "imu_selection").severity == "pass"


def test_parameters_that_change_in_flight() -> None:
    flight = made_flight()
    changed = flight.parameters.changed
    changed += [
        ParameterChange(2_000_000, "EKF2_GPS_V_NOISE", 0.5),  # on the ground
        ParameterChange(20_000_000, "EKF2_MAG_DECL", 3.0),  # stored by the estimator itself
        ParameterChange(20_000_000, "MPC_XY_P", 1.0),  # not the estimator's
    ]
    assert check_of(flight, "parameter_changes").severity == "pass"
    changed.append(ParameterChange(21_000_000, "EKF2_BARO_NOISE", 2.0))
    check = check_of(flight, "parameter_changes")
    assert (check.severity, check.figure) == ("warning", 1.0)
    assert "EKF2_BARO_NOISE = 2 at 20.0 s" in check.found


@pytest.mark.parametrize(
    ("version", "status", "said"),
    [
        (0x011001FF, "pass", "v1.16.1"),
        (0x010F00FF, "warning", "terrain in a filter of its own"),
        (0x010E00FF, "warning", "another error state"),
        (0x010D03FF, "warning", "v1.16 is the nearest of those: its EKF2 took the height from one source at a time"),
        (0x010800FF, "warning", "older than all releases whose estimator is modelled"),
        (0x011100FF, "warning", "is newer"),
        (0, "warning", "does not say which release"),
    ],
)
def test_firmware_whose_behaviour_is_not_modelled_is_named(
    version: int, status: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(judged_flight, "replayed_release", partial(replayed_release, modelled=("v1.16",)))
    flight = made_flight()
    # without parameters its number alone tells
    flight = replace(flight, parameters=ParameterHistory(), info={"ver_sw_release": version})
    check = check_of(flight, "firmware")
    assert check.severity == status
    assert said in check.found


@pytest.mark.parametrize(
    ("name", "value"), [("EKF2_GPS_V_NOISE", 1e30), ("EKF2_BARO_NOISE", np.nan), ("EKF2_GPS_V_NOISF", 1)]
)
def test_damaged_parameters_are_named(name: str, value: float) -> None:
    flight = made_flight()
    assert check_of(flight, "parameter_values").severity == "pass"
    flight.parameters.initial[name] = value
    check = check_of(flight, "parameter_values")
    assert check.severity == "warning"
    assert name in check.found


def test_a_parameter_that_cannot_be_is_named_with_what_takes_its_place() -> None:
    flight = made_flight()
    flight.parameters.initial |= {"EKF2_EV_DELAY": 6e26, "EKF2_GPS_DELAY": 310.0}
    flight.parameters.changed.append(ParameterChange(21_000_000, "EKF2_HGT_REF", 3e38))
    check = check_of(flight, "parameter_values")
    assert check.figure == 3.0
    assert "EKF2_EV_DELAY = 6e+26 cannot be: replayed with its default 0" in check.found
    assert "EKF2_HGT_REF = 3e+38 cannot be: the change in flight is left out, 1 stays" in check.found
    assert "EKF2_GPS_DELAY = 310 is outside 0 to 300: replayed as it flew" in check.found


def test_defaults_of_old_releases_are_in_range() -> None:
    flight = made_flight()
    flight.parameters.initial["EKF2_DECL_TYPE"] = 7  # default of v1.13; the highest value is now 3
    assert check_of(flight, "parameter_values").severity == "pass"


def test_topics_without_definition() -> None:
    flight = replace(made_flight(), undefined_topics=("vehicle_attitude",))
    assert check_of(flight, "definitions").severity == "warning"
    flight = replace(flight, undefined_topics=("sensor_combined",))
    del flight.topics["sensor_combined", 0]
    assert "message definitions of sensor_combined" in judged(flight).reasons[0]


def test_messages_left_out_for_their_time_are_counted() -> None:
    left_out = (LeftOut("sensor_combined", 0, 2, 12_002, "impossible time stamp"),)
    check = check_of(replace(made_flight(), left_out=left_out), "time_stamps")
    assert (check.severity, check.figure) == ("warning", pytest.approx(2 / 12_002))
    left_out = (LeftOut("sensor_combined", 0, 200, 12_002, "impossible time stamp"),)
    assert judged(replace(made_flight(), left_out=left_out)).status == "refused"


def test_aid_source_without_its_values_counts_as_absent() -> None:
    flight = made_flight()
    del flight.topics["vehicle_magnetometer", 0]["magnetometer_ga[1]"]
    assert judged(flight).status == "replayable"
    assert "no magnetometer samples" in check_of(flight, "magnetometer").found
    assert "lacks the field magnetometer_ga[1]" in check_of(flight, "sensor_values").found


def test_damage_that_was_passed_over_is_told() -> None:
    check = check_of(replace(made_flight(), corruption=("12 bytes are no records",)), "readable")
    assert check.severity == "warning"
    assert "12 bytes are no records" in check.found


def without_velocity(version: int) -> Flight:
    flight = made_flight()
    flight.info["ver_sw_release"] = version
    table = flight.topics["vehicle_gps_position", 0]
    table["vel_ned_valid"] = np.zeros(len(table["timestamp"]), np.bool_)
    return flight


def test_gnss_that_the_estimator_does_not_take_is_no_aid() -> None:
    flight = without_velocity(0x011000FF)
    rows = len(flight.topics["vehicle_gps_position", 0]["timestamp"])
    for name in ("gnss", "horizontal_aid"):
        check = check_of(flight, name)
        assert check.severity == "warning"
        assert f"given 0 of {rows} samples of GNSS ({rows} velocity not valid (vel_ned_valid))" in check.found
    assert "horizontal aiding by" not in " ".join(judged(flight).warnings)
    assert f"0 of {rows} of GNSS" in check_of(flight, "samples_given").found


def test_releases_that_took_gnss_without_the_velocity_flag_are_aided_by_it() -> None:
    flight = without_velocity(0x010B00FF)
    assert check_of(flight, "gnss").severity == "pass"
    assert check_of(flight, "horizontal_aid").found == "horizontal aiding by GNSS"


def test_gnss_of_which_a_part_is_not_taken_is_warned_of() -> None:
    flight = without_velocity(0x011000FF)
    valid = flight.topics["vehicle_gps_position", 0]["vel_ned_valid"]
    valid[: len(valid) // 2] = True
    check = check_of(flight, "gnss")
    assert (check.severity, check.figure, check.threshold) == ("warning", 0.5, 0.8)
    assert check_of(flight, "horizontal_aid").severity == "pass"


@pytest.mark.parametrize(
    "field", ["latitude_deg", "vel_e_m_s", "eph", "epv", "s_variance_m_s", "fix_type", "satellites_used"]
)
def test_gnss_without_a_field_is_left_out_for_that_reason(field: str) -> None:
    flight = made_flight()
    table = flight.topics["vehicle_gps_position", 0]
    rows = len(table.pop(field))
    verdict = judged(flight)
    assert verdict.status == "replayable"
    left_out = check_of(flight, "sensor_values")
    assert left_out.found == (f"{rows} messages left out ({rows} of vehicle_gps_position: lacks the field {field})")
    assert "kept some fields only" in left_out.remedy
    for name in ("gnss", "horizontal_aid"):
        check = check_of(flight, name)
        assert check.severity == "warning"
        assert f"lacks the field {field}" in check.found
        assert "kept some fields only" in check.remedy
    assert not any("3D fix" in warning for warning in verdict.warnings)


@pytest.mark.parametrize(
    ("topic", "field", "name"),
    [
        ("vehicle_magnetometer", "magnetometer_ga[1]", "magnetometer"),
        ("vehicle_air_data", "baro_alt_meter", "barometer"),
    ],
)
def test_sensors_without_a_field_name_it(topic: str, field: str, name: str) -> None:
    flight = made_flight()
    flight.parameters.initial["EKF2_GPS_CTRL"] = 7
    del flight.topics[topic, 0][field]
    check = check_of(flight, name)
    assert check.severity == "warning"
    assert f"lacks the field {field}" in check.found
    assert "kept some fields only" in check.remedy


def test_vision_of_an_unknown_frame_does_not_aid() -> None:
    flight = made_flight()
    flight.parameters.initial |= {"EKF2_GPS_CTRL": 0, "EKF2_EV_CTRL": 1}
    time = flight.topics["vehicle_air_data", 0]["timestamp"]
    position = {f"position[{axis}]": np.ones(len(time), np.float32) for axis in range(3)}
    vision = {"timestamp": time, "pose_frame": np.zeros(len(time), np.uint8), **position}
    flight.topics["vehicle_visual_odometry", 0] = vision
    said = f"given 0 of {len(time)} samples of external vision's position ({len(time)} of an unknown frame)"
    assert said in check_of(flight, "horizontal_aid").found
    assert check_of(flight, "samples_given").severity == "warning"
    vision["pose_frame"][:] = 2
    assert check_of(flight, "horizontal_aid").found == "horizontal aiding by external vision"
    del vision["pose_frame"]
    assert "external vision samples that can be used (each lacks the field pose_frame)" in (
        check_of(flight, "horizontal_aid").found
    )


def test_a_range_finder_that_looks_elsewhere_measures_no_height() -> None:
    flight = made_flight()
    del flight.topics["vehicle_air_data", 0]
    flight.parameters.initial |= {"EKF2_GPS_CTRL": 0, "EKF2_RNG_CTRL": 2}
    time = flight.topics["vehicle_magnetometer", 0]["timestamp"]
    down = np.full(len(time), 25, np.uint8)
    ranges = {"timestamp": time, "current_distance": np.ones(len(time), np.float32), "orientation": down}
    flight.topics["distance_sensor", 0] = ranges
    assert "height from range finder" in check_of(flight, "barometer").found
    down[:] = 0
    assert check_of(flight, "barometer").severity == "fail"
    assert "not facing down" in check_of(flight, "samples_given").found


def slow_barometer(profile: int, *, lost: int = 0) -> Flight:
    """A barometer of 2 Hz, of which `ekf2_timestamps` names every sample; some of them are not in the log."""
    flight = made_flight()
    baro = flight.topics["vehicle_air_data", 0]
    taken = {name: values[:: SLOW_HZ // 2] for name, values in baro.items()}
    flight.topics["vehicle_air_data", 0] = {name: values[lost:] for name, values in taken.items()}
    updates = flight.topics["sensor_combined", 0]["timestamp"][::2]
    rows = {"vehicle_air_data": taken["timestamp"], "vehicle_magnetometer": baro["timestamp"]}
    table = {"timestamp": updates}
    for topic, times in rows.items():
        relative = np.full(len(updates), 0x7FFF, np.int16)
        relative[np.searchsorted(updates, times)] = 0
        table[f"{topic}_timestamp_rel"] = relative
    flight.topics["ekf2_timestamps", 0] = table
    flight.parameters.initial |= {"SDLOG_PROFILE": profile, "SDLOG_MODE": 2, "EKF2_LOG_VERBOSE": 1}
    return flight


def test_a_slow_sensor_is_no_thinned_log() -> None:
    flight = slow_barometer(3)
    check = check_of(flight, "logging_profile")
    assert (check.severity, check.found) == ("pass", "every sample of magnetometer and barometer is in the log")
    check = check_of(flight, "barometer")
    assert (check.severity, check.figure) == ("warning", pytest.approx(2.0))
    assert "itself gives only 2.0 Hz" in check.found
    assert "SDLOG" not in check.remedy
    assert "SENS_BARO_RATE" in check.remedy


def test_samples_that_the_logger_lost_are_told_without_advice_to_set_what_is_set() -> None:
    check = check_of(slow_barometer(3, lost=60), "logging_profile")
    assert check.severity == "warning"
    assert "50% of the barometer's" in check.found
    assert "SD card" in check.remedy
    assert "SDLOG" not in check.remedy


@pytest.mark.parametrize(
    ("mode", "words"), [(0, "Set SDLOG_MODE = 2"), (1, "Set SDLOG_MODE = 2"), (2, "at boot already")]
)
def test_a_late_log_is_not_told_to_set_what_is_set(mode: int, words: str) -> None:
    flight = made_flight()
    flight.parameters.initial["SDLOG_MODE"] = mode
    flight.topics["vehicle_land_detected", 0]["timestamp"][1] -= 5_000_000
    check = check_of(flight, "log_start")
    assert check.severity == "warning"
    assert words in check.remedy


def test_a_sensor_without_samples_under_the_profile_for_replay() -> None:
    flight = made_flight()
    del flight.topics["vehicle_magnetometer", 0]
    remedy = check_of(flight, "magnetometer").remedy
    assert "SDLOG_PROFILE = 3" in remedy
    assert "Log with" not in remedy
    flight.parameters.initial["SDLOG_PROFILE"] = 1
    assert "Log with SDLOG_PROFILE = 3" in check_of(flight, "magnetometer").remedy


def test_topics_by_another_clock_are_told_with_their_remedy() -> None:
    left_out = (LeftOut("custom", 0, 9000, 9000, ANOTHER_CLOCK),)
    check = check_of(replace(made_flight(), left_out=left_out), "time_stamps")
    assert check.severity == "warning"
    assert "autopilot's time" in check.remedy


def test_thousands_of_changes_are_told_in_short() -> None:
    flight = made_flight()
    imu = flight.topics["sensor_combined", 0]["timestamp"]
    turns = {"timestamp": imu, "primary_instance": (np.arange(len(imu)) % 2).astype(np.uint8)}
    flight.topics["estimator_selector_status", 0] = turns
    flight.topics["sensor_selection", 0] = {"timestamp": imu, "gyro_device_id": np.arange(len(imu)) % 3}
    flight.parameters.changed += [ParameterChange(int(time), "EKF2_BARO_NOISE", 2.0) for time in imu]
    for name in ("estimator_instances", "imu_selection", "parameter_changes"):
        check = check_of(flight, name)
        assert check.severity == "warning"
        assert check.figure is not None
        assert check.figure > 5000
        assert len(check.found) < 500


def test_times_in_the_air_are_those_between_take_off_and_landing() -> None:
    """In the air from 12 s to 42 s after the first sample at 1 s, the begin included and the end not."""
    flight = made_flight()
    times = np.array([12_999_999, 13_000_000, 42_999_999, 43_000_000, 0, 10**9])
    assert is_airborne(flight, times).tolist() == [False, True, True, False, False, False]
    del flight.topics["vehicle_land_detected", 0]
    assert is_airborne(flight, times).all()
