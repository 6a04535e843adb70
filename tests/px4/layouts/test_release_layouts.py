"""Topics of old releases in the layout of v1.16; expected values are worked out by hand from each release's message."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fusetune.px4.flight import Flight, ParameterHistory, TopicTable
from fusetune.px4.layouts.estimator_instances import of_one_instance
from fusetune.px4.layouts.onboard_innovations import tables_of_test_ratios
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.ulog.reader import read_ulog

TIME = np.array([1_000_000, 1_004_000, 1_008_000, 1_012_000], np.int64)


def canonical_topic(name: str, table: TopicTable, wanted: str | None = None) -> TopicTable:
    result = canonical(Flight("made", {(name, 0): table})).topic(wanted or name)
    assert result is not None
    return result


def test_gnss_before_v1_15_is_scaled_to_degrees_and_metres() -> None:
    table = {
        "timestamp": TIME[:1],
        "lat": np.array([473977418], np.int32),
        "lon": np.array([-85455940], np.int32),
        "alt": np.array([488123], np.int32),
        "alt_ellipsoid": np.array([535456], np.int32),
        "vel_ned_valid": np.array([True]),
        "fix_type": np.array([3], np.uint8),
        "satellites_used": np.array([9], np.uint8),
    }
    table |= dict.fromkeys(("vel_n_m_s", "vel_e_m_s", "vel_d_m_s", "eph", "epv", "s_variance_m_s"), np.float32([0.5]))
    gnss = canonical_topic("vehicle_gps_position", table)
    assert gnss["latitude_deg"][0] == pytest.approx(47.3977418, abs=1e-12)
    assert gnss["longitude_deg"][0] == pytest.approx(-8.5455940, abs=1e-12)
    assert gnss["altitude_msl_m"][0] == pytest.approx(488.123)
    assert gnss["altitude_ellipsoid_m"][0] == pytest.approx(535.456)
    assert np.isnan(gnss["heading"][0])
    assert gnss["timestamp_sample"][0] == TIME[0]
    assert gnss["lat"][0] == 473977418


def test_integration_times_in_seconds_become_microseconds() -> None:
    table = {"timestamp": TIME, "gyro_integral_dt": np.full(4, 0.004, np.float32)}
    assert canonical_topic("sensor_combined", table)["gyro_integral_dt"].tolist() == [4000] * 4


def test_magnetometer_and_barometer_inside_sensor_combined() -> None:
    """A sample is new where its own time has moved on; 0x7fffffff means that there is none."""
    none = 0x7FFFFFFF
    table: TopicTable = {
        "timestamp": TIME,
        "magnetometer_timestamp_relative": np.array([none, -1000, -5000, -1000], np.int32),
        "baro_timestamp_relative": np.array([-500, -4500, -500, none], np.int32),
        "baro_alt_meter": np.array([10.0, 10.0, 11.0, 12.0], np.float32),
        "gyro_integral_dt": np.full(4, 0.004, np.float32),
    }
    for axis in range(3):
        table[f"magnetometer_ga[{axis}]"] = np.array([0.0, 0.1, 0.1, 0.2], np.float32)
    flight = canonical(Flight("v1.6", {("sensor_combined", 0): table}))
    mag, baro = flight.topic("vehicle_magnetometer"), flight.topic("vehicle_air_data")
    assert mag is not None
    assert baro is not None
    assert mag["timestamp_sample"].tolist() == [1_003_000, 1_011_000]
    assert mag["timestamp"].tolist() == [1_004_000, 1_012_000]
    np.testing.assert_allclose(mag["magnetometer_ga[2]"], [0.1, 0.2], rtol=1e-6)
    assert baro["timestamp_sample"].tolist() == [999_500, 1_007_500]
    assert baro["baro_alt_meter"].tolist() == [10.0, 11.0]
    assert baro["rho"].tolist() == [np.float32(1.225)] * 2


def test_at_rest_is_taken_from_landed_where_it_is_missing() -> None:
    land = canonical_topic("vehicle_land_detected", {"timestamp": TIME, "landed": np.array([1, 1, 0, 1], bool)})
    assert land["at_rest"].tolist() == [True, True, False, True]
    assert not land["in_ground_effect"].any()


def test_vehicle_type_from_the_flag_of_v1_8() -> None:
    status = canonical_topic(
        "vehicle_status",
        {"timestamp": TIME[:2], "arming_state": np.uint8([1, 2]), "is_rotary_wing": np.array([True, False])},
    )
    assert status["vehicle_type"].tolist() == [1, 2]


def test_optical_flow_of_v1_13_under_its_new_names() -> None:
    old = {
        "timestamp": TIME[:1],
        "pixel_flow_x_integral": np.float32([0.1]),
        "pixel_flow_y_integral": np.float32([0.2]),
        "gyro_x_rate_integral": np.float32([0.3]),
        "gyro_y_rate_integral": np.float32([0.4]),
        "gyro_z_rate_integral": np.float32([0.5]),
        "integration_timespan": np.array([20_000], np.uint32),
        "ground_distance_m": np.float32([1.5]),
        "quality": np.array([200], np.uint8),
    }
    flow = canonical_topic("optical_flow", old, "vehicle_optical_flow")
    columns = ["pixel_flow[0]", "pixel_flow[1]", "delta_angle[0]", "delta_angle[1]", "delta_angle[2]", "distance_m"]
    np.testing.assert_allclose([flow[column][0] for column in columns], [0.1, 0.2, 0.3, 0.4, 0.5, 1.5], rtol=1e-6)
    assert flow["integration_timespan_us"][0] == 20_000


def test_odometry_of_v1_13_with_covariances_as_variances() -> None:
    """The diagonal of a 6×6 upper triangle by rows stands at 0, 6, 11, 15, 18, 20."""
    old: TopicTable = {"timestamp": TIME[:3], "local_frame": np.array([0, 1, 2], np.uint8)}
    old["velocity_frame"] = np.array([0, 3, 2], np.uint8)
    for name in ("x", "y", "z", "vx", "vy", "vz"):
        old[name] = np.full(3, ord(name[-1]), np.float32)
    for entry in range(21):
        old[f"pose_covariance[{entry}]"] = np.full(3, entry, np.float32)
        old[f"velocity_covariance[{entry}]"] = np.full(3, 100 + entry, np.float32)
    vision = canonical_topic("vehicle_visual_odometry", old)
    assert [vision[f"position[{axis}]"][0] for axis in range(3)] == [ord("x"), ord("y"), ord("z")]
    assert [vision[f"position_variance[{axis}]"][0] for axis in range(3)] == [0, 6, 11]
    assert [vision[f"orientation_variance[{axis}]"][0] for axis in range(3)] == [15, 18, 20]
    assert [vision[f"velocity_variance[{axis}]"][0] for axis in range(3)] == [100, 106, 111]
    assert vision["pose_frame"].tolist() == [1, 2, 0]
    assert vision["velocity_frame"].tolist() == [1, 3, 0]
    assert vision["reset_counter"].tolist() == [0, 0, 0]


def test_vision_of_v1_8_takes_the_newest_attitude() -> None:
    position: TopicTable = {"timestamp": TIME, **{name: np.zeros(4, np.float32) for name in "xyz"}}
    position |= {"eph": np.full(4, 0.5, np.float32), "epv": np.full(4, 2.0, np.float32)}
    attitude: TopicTable = {"timestamp": TIME[[1, 3]] - 10}
    attitude |= {f"q[{part}]": np.array([0.1, 0.2], np.float32) for part in range(4)}
    topics = {("vehicle_vision_position", 0): position, ("vehicle_vision_attitude", 0): attitude}
    vision = canonical(Flight("v1.8", topics)).topic("vehicle_visual_odometry")
    assert vision is not None
    np.testing.assert_array_equal(vision["q[0]"], np.float32([np.nan, 0.1, 0.1, 0.2]))
    assert vision["position_variance[0]"].tolist() == [0.25] * 4
    assert vision["position_variance[2]"].tolist() == [4.0] * 4
    assert np.isnan(vision["velocity[0]"]).all()


def test_primary_estimator_instance_decides_on_the_magnetometer() -> None:
    field = {f"magnetometer_ga[{axis}]": np.zeros(4, np.float32) for axis in range(3)}
    topics = {
        ("vehicle_magnetometer", 0): {"timestamp": TIME, "device_id": np.full(4, 11, np.uint32), **field},
        ("vehicle_magnetometer", 1): {"timestamp": TIME, "device_id": np.full(4, 22, np.uint32), **field},
        ("estimator_selector_status", 0): {"timestamp": TIME, "primary_instance": np.array([0, 2, 2, 2], np.uint8)},
        ("estimator_status", 0): {"timestamp": TIME, "mag_device_id": np.full(4, 11, np.uint32)},
        ("estimator_status", 2): {"timestamp": TIME, "mag_device_id": np.array([0, 22, 22, 22], np.uint32)},
    }
    flight = Flight("multi", topics)
    followed = canonical(flight).topics["vehicle_magnetometer", 0]
    assert followed["device_id"].tolist() == [11, 22, 22, 22]
    assert canonical(of_one_instance(flight)).topics["vehicle_magnetometer", 0]["device_id"].tolist() == [22] * 4
    assert flight.topics["vehicle_magnetometer", 0]["device_id"][0] == 11


def test_status_flags_before_v1_12_from_bits() -> None:
    status = {
        "timestamp": TIME[:2],
        "control_mode_flags": np.array([0b1, (1 << 2) | (1 << 7) | (1 << 24)], np.uint32),
        "filter_fault_flags": np.array([0, 1 << 16], np.uint32),
    }
    flags = canonical_topic("estimator_status", status, "estimator_status_flags")
    assert flags["cs_tilt_align"].tolist() == [True, False]
    assert flags["cs_gnss_pos"].tolist() == flags["cs_gnss_vel"].tolist() == [False, True]
    assert flags["cs_in_air"].tolist() == flags["cs_ev_vel"].tolist() == [False, True]
    assert flags["fs_bad_acc_vertical"].tolist() == [False, True]


@pytest.mark.parametrize("split", [True, False], ids=["v1.11", "v1.10"])
def test_rejections_before_v1_12_from_bits(split: bool) -> None:
    """Velocity has two bits from v1.11 on, horizontal and vertical; before, one, and all others are a bit lower."""
    bits = [0b1, 0b100, 1 << 7] if split else [0b1, 0b10, 1 << 6]
    status = {
        "timestamp": TIME[:3],
        "control_mode_flags": np.zeros(3, np.uint32),
        "innovation_check_flags": np.array(bits, np.uint16),
    }
    if split:
        status["pre_flt_fail_innov_heading"] = np.zeros(3, np.bool_)
    flags = canonical_topic("estimator_status", status, "estimator_status_flags")
    assert flags["reject_hor_vel"].tolist() == [True, False, False]
    assert flags["reject_ver_vel"].tolist() == [not split, False, False]
    assert flags["reject_hor_pos"].tolist() == [False, True, False]
    assert flags["reject_yaw"].tolist() == [False, False, True]


def innovation_flight(**innovations: np.ndarray) -> Flight:
    rows = len(next(iter(innovations.values())))
    time = np.arange(rows, dtype=np.int64) * 500_000 + 1_000_000
    variances = {name: np.full(rows, 4.0, np.float32) for name in innovations}
    ratios = {name: np.full(rows, 0.5, np.float32) for name in innovations}
    ratios[next(iter(innovations))][-1] = 1.5
    topics = {
        ("estimator_innovations", 0): {"timestamp": time, **innovations},
        ("estimator_innovation_variances", 0): {"timestamp": time + 40, **variances},
        ("estimator_innovation_test_ratios", 0): {"timestamp": time + 80, **ratios},
        ("estimator_status", 0): {"timestamp": time[:1], "control_mode_flags": np.array([1 << 2], np.uint32)},
    }
    return Flight("v1.11", topics, ParameterHistory({"EKF2_GPS_V_GATE": 3.0}))


def test_innovations_of_v1_11_become_aid_source_topics() -> None:
    values = np.array([1.0, 1.0, 2.0, -6.0], np.float32)
    flight = innovation_flight(
        **{"gps_hvel[0]": values, "gps_hvel[1]": values, "gps_vvel": values, "baro_vpos": values}
    )
    aid = canonical(flight).topic("estimator_aid_src_gnss_vel")
    assert aid is not None
    # the second row repeats the first: no new sample
    assert aid["timestamp"].tolist() == [1_000_000, 2_000_000, 2_500_000]
    np.testing.assert_allclose(aid["innovation[1]"], [1.0, 2.0, -6.0])
    # ν² / (3² · 4)
    np.testing.assert_allclose(aid["test_ratio[0]"], [1 / 36, 4 / 36, 36 / 36], rtol=1e-6)
    assert aid["innovation_rejected"].tolist() == [False, False, True]
    assert aid["fused"].tolist() == [True, True, False]
    baro = canonical(flight).topic("estimator_aid_src_baro_hgt")
    assert baro is not None
    assert not baro["fused"].any()


def test_instances_with_aid_source_topics_of_their_own_stay_as_they_are() -> None:
    flight = innovation_flight(baro_vpos=np.array([1.0, 2.0], np.float32))
    own = {"timestamp": TIME[:1], "innovation": np.float32([7.0])}
    flight.topics["estimator_aid_src_baro_hgt", 0] = own
    result = canonical(flight)
    assert result.topics["estimator_aid_src_baro_hgt", 0] is own


def test_test_ratios_alone_tell_of_the_sources_that_the_flags_name() -> None:
    """One ratio for both horizontal axes, in the first; a row for each new sample; what is no number is no ratio."""
    time = np.arange(6, dtype=np.int64) * 500_000 + 1_000_000
    ratios = {
        "timestamp": time,
        "gps_hvel[0]": np.array([0.1, 0.1, 0.4, 1.5, 0.3, np.inf], np.float32),
        "gps_hvel[1]": np.full(6, np.nan, np.float32),
        "gps_vvel": np.array([0.2, 0.2, 0.2, 0.1, 0.1, 0.0], np.float32),
        "ev_hvel[0]": np.full(6, 0.7, np.float32),
        "ev_hvel[1]": np.zeros(6, np.float32),
        "ev_vvel": np.zeros(6, np.float32),
    }
    status = {"timestamp": time, "control_mode_flags": np.array([1 << 2] * 4 + [0, 1 << 2], np.uint32)}
    flight = Flight("thinned", {("estimator_innovation_test_ratios", 1): ratios, ("estimator_status", 1): status})
    tables = tables_of_test_ratios(flight, 1)
    assert list(tables) == [("estimator_aid_src_gnss_vel", 1)]
    aid = tables["estimator_aid_src_gnss_vel", 1]
    # the second repeats the first, in the fifth GNSS is not fused, in the last nothing is known
    assert aid["timestamp"].tolist() == time[[0, 2, 3]].tolist()
    np.testing.assert_allclose(aid["test_ratio[0]"], [0.1, 0.4, 1.5])
    np.testing.assert_allclose(aid["test_ratio[2]"], [0.2, 0.2, 0.1])
    assert aid["innovation_rejected"].tolist() == [False, False, True]
    assert aid["fused"].tolist() == [True, True, False]
    assert np.isnan(aid["innovation[0]"]).all()
    assert not tables_of_test_ratios(flight, 0)


def test_old_height_slot_belongs_to_the_active_height_source() -> None:
    rows = 3
    old: TopicTable = {"timestamp": TIME[:rows]}
    for axis in range(6):
        old[f"vel_pos_innov[{axis}]"] = np.arange(rows, dtype=np.float32) + 1.0
        old[f"vel_pos_innov_var[{axis}]"] = np.ones(rows, np.float32)
    status = {
        "timestamp": TIME[:rows],
        "control_mode_flags": np.array([(1 << 2) | (1 << 9), (1 << 2) | (1 << 9), 1 << 10], np.uint32),
    }
    flight = canonical(Flight("v1.9", {("ekf2_innovations", 0): old, ("estimator_status", 0): status}))
    baro, range_height = flight.topic("estimator_aid_src_baro_hgt"), flight.topic("estimator_aid_src_rng_hgt")
    assert baro is not None
    assert range_height is not None
    assert baro["innovation"].tolist() == [1.0, 2.0]
    assert range_height["innovation"].tolist() == [3.0]
    assert flight.topic("estimator_aid_src_gnss_hgt") is None


HDG, MAG_3D, GNSS_YAW, EV_YAW = 1 << 4, 1 << 5, 1 << 22, 1 << 13


def heading_flight(old: bool, release: int | None, flags: list[int], values: list[float]) -> Flight:
    """A log whose one field of heading innovations is written while the given control flags are set."""
    rows = len(values)
    time = np.arange(rows, dtype=np.int64) * 200_000 + 1_000_000
    innovation, variance = np.array(values, np.float32), np.full(rows, 0.04, np.float32)
    topics: dict[tuple[str, int], TopicTable] = {
        ("estimator_status", 0): {"timestamp": time - 50_000, "control_mode_flags": np.array(flags, np.uint32)}
    }
    if old:
        columns = {"heading_innov": innovation, "heading_innov_var": variance}
        topics["ekf2_innovations", 0] = {"timestamp": time, **columns}
    else:
        topics["estimator_innovations", 0] = {"timestamp": time, "heading": innovation}
        topics["estimator_innovation_variances", 0] = {"timestamp": time, "heading": variance}
    info = {} if release is None else {"ver_sw_release": (1 << 24) | (release << 16) | 255}
    return Flight("made", topics, info=info)


@pytest.mark.parametrize(("old", "release"), [(True, 8), (True, 10), (False, 11), (False, 13), (False, 14)])
@pytest.mark.parametrize(
    ("flag", "source"), [(HDG, "mag_heading"), (GNSS_YAW, "gnss_yaw"), (EV_YAW, "ev_yaw"), (MAG_3D, None)]
)
def test_heading_innovations_belong_to_the_sensor_in_use(old: bool, release: int, flag: int, source: str) -> None:
    flight = canonical(heading_flight(old, release, [flag] * 3, [0.01, 0.02, 0.03]))
    for name in ("mag_heading", "gnss_yaw", "ev_yaw"):
        aid = flight.topic(f"estimator_aid_src_{name}")
        if name != source:
            assert aid is None, name
            continue
        assert aid is not None
        np.testing.assert_allclose(aid["innovation"], [0.01, 0.02, 0.03])
        # ν² / (2.6² · 0.04), 2.6 being the default of EKF2_HDG_GATE
        np.testing.assert_allclose(aid["test_ratio"], np.square([0.01, 0.02, 0.03]) / (2.6**2 * 0.04), rtol=1e-5)
        assert aid["fused"].all()


def test_from_v1_15_on_heading_is_no_heading_while_the_magnetometer_is_fused() -> None:
    for flag, made in ((HDG, False), (MAG_3D, False), (EV_YAW, True)):
        flight = canonical(heading_flight(False, 15, [flag] * 3, [0.01, 0.02, 0.03]))
        assert not flight.has("estimator_aid_src_mag_heading")
        assert flight.has("estimator_aid_src_ev_yaw") == made


def test_the_sensor_of_the_heading_may_change_in_flight() -> None:
    """The row between two messages of the status that disagree, and a value left by the other sensor, are nobody's."""
    flags = [HDG, HDG, HDG, EV_YAW, EV_YAW, EV_YAW]
    flight = canonical(heading_flight(False, 13, flags, [0.1, 0.2, 0.3, 0.3, 0.4, 0.5]))
    magnetic, vision = (flight.topic(f"estimator_aid_src_{name}") for name in ("mag_heading", "ev_yaw"))
    assert magnetic is not None
    assert vision is not None
    np.testing.assert_allclose(magnetic["innovation"], [0.1, 0.2])
    np.testing.assert_allclose(vision["innovation"], [0.4, 0.5])


def test_a_heading_without_status_is_nobodys() -> None:
    flight = heading_flight(False, 13, [HDG] * 3, [0.1, 0.2, 0.3])
    del flight.topics["estimator_status", 0]
    assert not any(name.startswith("estimator_aid_src_") for name, _ in canonical(flight).topics)


def test_old_velocity_and_position_slots_belong_to_the_source_in_use() -> None:
    gnss, vision_position, vision_velocity = 1 << 2, 1 << 12, 1 << 24
    flags = [
        gnss,
        gnss,
        vision_position | vision_velocity,
        vision_position | vision_velocity,
        gnss | vision_position,
        0,
    ]
    old: TopicTable = {"timestamp": np.arange(6, dtype=np.int64) * 200_000 + 1_000_000}
    for axis in range(6):
        old[f"vel_pos_innov[{axis}]"] = np.arange(6, dtype=np.float32) + 1.0
        old[f"vel_pos_innov_var[{axis}]"] = np.ones(6, np.float32)
    status = {"timestamp": old["timestamp"], "control_mode_flags": np.array(flags, np.uint32)}
    flight = canonical(Flight("v1.10", {("ekf2_innovations", 0): old, ("estimator_status", 0): status}))
    found = {
        name: aid["innovation[0]"].tolist()
        for name in ("gnss_vel", "gnss_pos", "ev_vel", "ev_pos")
        if (aid := flight.topic(f"estimator_aid_src_{name}")) is not None
    }
    # With GNSS and vision both in use the position is either's; its velocity is that of GNSS.
    assert found == {"gnss_vel": [1.0, 2.0, 5.0], "gnss_pos": [1.0, 2.0], "ev_vel": [3.0, 4.0], "ev_pos": [3.0, 4.0]}


def test_every_shared_log_has_the_v1_16_fields(shared_logs: Path) -> None:
    needed = {
        "sensor_combined": ("gyro_rad[2]", "gyro_integral_dt", "accelerometer_m_s2[2]", "accelerometer_clipping"),
        "vehicle_magnetometer": ("timestamp_sample", "magnetometer_ga[2]", "device_id", "calibration_count"),
        "vehicle_air_data": ("timestamp_sample", "baro_alt_meter", "rho", "baro_device_id", "calibration_count"),
        "vehicle_gps_position": ("latitude_deg", "altitude_msl_m", "eph", "epv", "s_variance_m_s", "vel_ned_valid"),
        "vehicle_land_detected": ("landed", "at_rest", "in_ground_effect"),
        "vehicle_status": ("arming_state", "vehicle_type"),
        "vehicle_visual_odometry": ("position[2]", "position_variance[2]", "pose_frame", "quality"),
        "estimator_status_flags": ("cs_tilt_align", "cs_gnss_pos", "cs_in_air"),
        "estimator_states": ("states[23]", "covariances[23]"),
    }
    for log in sorted(shared_logs.glob("*.ulg")):
        flight = canonical(read_ulog(log))
        assert flight.topics["sensor_combined", 0]["gyro_integral_dt"].dtype.kind in "iu"
        for topic, fields in needed.items():
            table = flight.topic(topic)
            if table is not None:
                assert not set(fields) - table.keys(), (log.stem, topic)
                assert len({len(values) for values in table.values()}) == 1


def test_magnetometer_of_the_log_that_switches_instances(shared_logs: Path, shared_reference: Path) -> None:
    """PX4's own replay of the primary instance used the magnetometer whose readings the reference observes."""
    pq = pytest.importorskip("pyarrow.parquet")
    name = "Chainplain__log_9_2024-10-14-15-00-06"
    rows = pq.read_table(shared_reference / name / "asflown.innovations.parquet").to_pandas()
    observed = rows[(rows.source == "mag") & (rows.axis == 0)].observation.to_numpy()
    one = of_one_instance(read_ulog(shared_logs / f"{name}.ulg"))
    used = canonical(one).topics["vehicle_magnetometer", 0]["magnetometer_ga[0]"]
    assert np.all(np.abs(observed[:, np.newaxis] - used).min(axis=1) < 1e-6)
