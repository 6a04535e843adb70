"""The table of aid sources against PX4: its parameters per release, its recorded axes, its messages, its flags."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from fusetune.ekf2.feed.taken_samples import AIDING
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_AXES, AID_SOURCE_NAMES
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCES as STATUS
from fusetune.ekf2.filter.common.aid_source_status import OLD_AID_SOURCES as OLD_STATUS
from fusetune.ekf2.filter.common.parameters import DELAY_PARAMETERS
from fusetune.ekf2.replay.recording import FLAG_COLUMNS
from fusetune.px4.aid_sources import (
    AID_SOURCES,
    AXES,
    HORIZONTAL_AIDING,
    MEASURED_SOURCES,
    OLD_SOURCES,
    RECORDED_SOURCES,
    REPLAYED_SOURCES,
    REPORTED_SOURCES,
    SENSOR_TOPICS,
    SENSORS,
    WITHHOLDABLE,
    AidSource,
)
from fusetune.px4.layouts.estimator_layouts import control_bits
from fusetune.px4.parameter_sources import observation_noise_of, required_sources, switched_off
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS
from fusetune.px4.releases import BASELINE

EVERY = pytest.mark.parametrize("source", AID_SOURCES.values(), ids=list(AID_SOURCES))


def _parameters(source: AidSource) -> set[str]:
    named = {source.gate_parameter, source.delay_parameter, source.switch and source.switch.parameter}
    return (
        {name for name in named if name} | {*source.noise_parameters} | {one.parameter for one in source.noise_floors}
    )


@EVERY
def test_every_parameter_exists_in_the_release_that_is_replayed(source: AidSource) -> None:
    for name in _parameters(source):
        assert ALL_PARAMETERS[name].exists_in(BASELINE), name


@EVERY
def test_parameters_have_the_kind_and_the_unit_of_what_they_are(source: AidSource) -> None:
    # as PX4 declares them: gates in standard deviations, delays in ms, and bits only of a bit mask
    if source.gate_parameter:
        assert ALL_PARAMETERS[source.gate_parameter].unit == "SD"
    if source.delay_parameter:
        assert ALL_PARAMETERS[source.delay_parameter].unit == "ms"
    if source.switch:
        assert (ALL_PARAMETERS[source.switch.parameter].kind == "bitmask") == bool(
            source.switch.bits or source.switch.parameter == "EKF2_AGP_CTRL"
        )


@EVERY
def test_every_start_of_a_name_begins_a_parameter_of_the_release_that_is_replayed(source: AidSource) -> None:
    names = [name for name, metadata in ALL_PARAMETERS.items() if metadata.exists_in(BASELINE)]
    for start in source.acts:
        assert any(name.startswith(start) for name in names), start


@EVERY
def test_own_parameters_act_through_the_source_that_they_are_of(source: AidSource) -> None:
    if source.measures and source.code is not None:
        for name in _parameters(source) - {"EKF2_IMU_CTRL"}:  # its other bits concern the biases
            assert source.name in required_sources(name), name


@EVERY
def test_groups_join_axes_that_the_source_has(source: AidSource) -> None:
    for name, axes in source.groups:
        assert name in ("horizontal", "vertical", "heading", "all")
        assert axes == tuple(sorted(set(axes)))
        assert set(axes) <= set(range(source.axes))
    assert 1 <= source.axes <= len(AXES)


@EVERY
def test_older_innovations_have_a_field_for_every_axis(source: AidSource) -> None:
    assert len(source.innovations) in (0, source.axes)
    assert len(source.ekf2_innovations) in (0, source.axes)


@EVERY
def test_flags_are_those_that_the_estimator_publishes(source: AidSource) -> None:
    assert set(source.flags) <= set(FLAG_COLUMNS)


@EVERY
def test_sensor_and_part_are_rows_of_the_table(source: AidSource) -> None:
    assert not source.sensor or source.sensor in SENSORS
    assert not source.part or AID_SOURCES[source.part].sensor == source.sensor
    assert not source.withheld or source.sensor


def test_control_bits_are_those_of_estimator_status() -> None:
    # ControlStatus of PX4: GPS is bit 2, EV_VEL bit 24; before v1.15 one bit stood for GNSS position and velocity
    assert control_bits(("cs_gnss_pos",)) == control_bits(("cs_gnss_vel",)) == 1 << 2
    assert control_bits(AID_SOURCES["mag"].flags) == 1 << 4 | 1 << 5
    assert control_bits(("cs_gps_hgt",)) == 1 << 11
    assert control_bits(("cs_gnss_yaw",)) == 1 << 22
    assert control_bits(("cs_ev_vel",)) == 1 << 24
    assert control_bits(("cs_gravity_vector", "cs_aux_gpos")) == 0  # came later


def test_codes_are_those_that_replays_were_written_with() -> None:
    # the order of the estimator's record: another one would give old tables other sources
    assert STATUS.names == REPLAYED_SOURCES
    assert RECORDED_SOURCES == AID_SOURCE_NAMES == OLD_STATUS.names
    assert RECORDED_SOURCES[: len(REPLAYED_SOURCES)] == REPLAYED_SOURCES
    assert [AID_SOURCES[name].code for name in REPLAYED_SOURCES] == list(range(len(REPLAYED_SOURCES)))
    assert REPLAYED_SOURCES[:4] == ("baro_hgt", "rng_hgt", "fake_hgt", "fake_pos")
    assert REPLAYED_SOURCES[-1] == "drag"


def test_all_sources_but_those_that_nothing_feeds_are_replayed() -> None:
    # docs/fidelity.md: all aid sources but the auxiliary global position
    assert {name for name, source in AID_SOURCES.items() if not source.is_replayed} == {
        *OLD_SOURCES,
        "aux_global_position",
    }


def test_axes_are_those_that_px4_publishes() -> None:
    # messages estimator_aid_source1d, 2d and 3d of PX4 v1.16, by what its Ekf class declares
    of_one = {"baro_hgt", "rng_hgt", "fake_hgt", "gnss_hgt", "ev_hgt", "gnss_yaw", "ev_yaw", "airspeed", "sideslip"}
    of_two = {"fake_pos", "gnss_pos", "ev_pos", "optical_flow", "aux_vel", "aux_global_position", "drag"}
    of_three = {"gnss_vel", "ev_vel", "mag", "gravity"}
    # and of v1.14
    of_one |= {"mag_heading", "terrain_range_finder"}
    of_two |= {"terrain_optical_flow"}
    assert dict.fromkeys(of_one, 1) | dict.fromkeys(of_two, 2) | dict.fromkeys(of_three, 3) == AID_SOURCE_AXES
    assert set(MEASURED_SOURCES) - set(REPLAYED_SOURCES) == {"mag_heading"}
    assert set(MEASURED_SOURCES) < set(AID_SOURCE_AXES)


def test_axes_and_fields_are_those_that_vehicles_logged(shared_logs: Path) -> None:
    from fusetune.px4.ulog.reader import read_ulog

    flight = read_ulog(shared_logs / "PX4__ekf_failure.ulg")
    logged = {name.removeprefix("estimator_aid_src_") for name, _ in flight.topics if "aid_src" in name}
    assert {"gnss_vel", "gnss_pos", "baro_hgt", "mag", "gravity", "fake_pos"} <= logged
    for name in logged:
        columns = [
            one for one in flight.topics[AID_SOURCES[name].topic, 0] if re.fullmatch(r"innovation(\[\d\])?", one)
        ]
        assert len(columns) == AID_SOURCES[name].axes, name


def test_the_replay_takes_samples_of_every_sensor_that_its_interface_buffers() -> None:
    assert list(AIDING) == [name for name, sensor in SENSORS.items() if sensor.buffered]
    # the delays over which PX4 sizes its buffers, estimator_interface.cpp: initialise_interface
    names = ("GPS", "MAG", "BARO", "RNG", "OF", "EV", "ASP", "AVEL")
    assert set(DELAY_PARAMETERS) == {f"EKF2_{name}_DELAY" for name in names}


def test_topics_are_named_once_and_their_limits_are_of_fields_with_room_between() -> None:
    topics = [topic for sensor in SENSORS.values() for topic in sensor.topics]
    assert len({topic.name for topic in topics}) == len(topics)
    for topic in topics:
        for name, limit in topic.limits.items():
            assert limit.low < limit.high, (topic.name, name)


def test_ekf2_timestamps_names_the_topics_that_it_has_fields_for() -> None:
    # msg/Ekf2Timestamps.msg of v1.16
    assert {topic.relative_field for topic in SENSOR_TOPICS.values()} - {""} == {
        f"{name}_timestamp_rel"
        for name in (
            "airspeed", "airspeed_validated", "distance_sensor", "optical_flow", "vehicle_air_data",
            "vehicle_magnetometer", "visual_odometry",
        )
    }  # fmt: skip


def test_what_can_be_withheld_is_predicted_on_all_its_sources() -> None:
    # in order: another one would plan the gaps of a flight otherwise
    assert list(WITHHOLDABLE.items()) == [
        ("gnss", ("gnss_pos", "gnss_vel", "gnss_hgt")),
        ("baro", ("baro_hgt",)),
        ("mag", ("mag",)),
    ]


def test_what_stops_the_drift_measures_motion_over_ground() -> None:
    assert {AID_SOURCES[name].quantity for name in HORIZONTAL_AIDING} == {"position", "velocity", "flow"}
    assert not {"fake_pos", "airspeed", "drag"} & set(HORIZONTAL_AIDING)


def test_what_the_report_shows_has_a_group_and_a_place_of_its_own() -> None:
    assert [source.place for source in REPORTED_SOURCES] == list(range(1, len(REPORTED_SOURCES) + 1))
    assert all(source.groups for source in REPORTED_SOURCES)


def test_the_longest_start_of_a_name_says_what_a_parameter_works_through() -> None:
    assert required_sources("EKF2_GPS_CHECK") == ("gnss_pos", "gnss_vel", "gnss_hgt", "gnss_yaw")
    assert required_sources("EKF2_GPS_P_NOISE") == ("gnss_pos", "gnss_hgt")
    assert set(required_sources("EKF2_HEAD_NOISE")) == {"mag", "gnss_yaw"}
    assert required_sources("EKF2_ACC_NOISE") == ()
    assert observation_noise_of("EKF2_EVP_NOISE") == ("ev_pos", "ev_hgt")
    assert observation_noise_of("EKF2_GPS_P_NOISE") == ()


@pytest.mark.parametrize(
    ("source", "parameter", "off", "on"),
    [
        ("gnss_vel", "EKF2_GPS_CTRL", 3, 4),
        ("mag", "EKF2_MAG_TYPE", 5, 0),
        ("airspeed", "EKF2_ARSP_THR", 0.0, 0.5),
        ("baro_hgt", "EKF2_BARO_CTRL", 0, 1),
        ("rng_hgt", "EKF2_RNG_CTRL", 0, 2),
        ("gravity", "EKF2_IMU_CTRL", 3, 7),
        ("aux_global_position", "EKF2_AGP_CTRL", 0, 2),
    ],
)
def test_switches_are_read_as_px4_reads_them(source: str, parameter: str, off: float, on: float) -> None:
    assert switched_off(source, {parameter: float(off)}) == f"{parameter} is {off:g}"
    assert switched_off(source, {parameter: float(on)}) == ""
    assert switched_off(source, {}) == ""


def test_values_that_no_sensor_gives_lie_beyond_its_limits() -> None:
    for topic in SENSOR_TOPICS.values():
        for name, limit in topic.limits.items():
            assert not limit.low <= np.finfo(np.float32).max <= limit.high, (topic.name, name)
