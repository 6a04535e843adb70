"""Terrain, range finder, flow, vision and air of releases until v1.15, each behaviour where it differs from v1.16's.

Expected: figures by hand of the formulas of docs/releases.md; v1.16 stands beside as what is otherwise.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.ekf2.filter.aiding_estimator import INTERVAL_US, START_US, set_time
from tests.ekf2.releases.test_named_behaviours import OLD as V116
from tests.ekf2.releases.test_named_behaviours import Flying, asked, flying

from fusetune.ekf2.feed.sensor_samples import (
    EV_FRAME_BODY_FRD,
    EV_FRAME_FRD,
    EV_FRAME_NED,
    IMU_SAMPLE,
    SYSTEM_FLAGS_SAMPLE,
)
from fusetune.ekf2.filter import wind
from fusetune.ekf2.filter.aid_sources.airspeed import airspeed_control, airspeed_fusion, airspeed_resets
from fusetune.ekf2.filter.aid_sources.drag import drag_fusion
from fusetune.ekf2.filter.aid_sources.drag.drag_accumulator import accumulate_drag, may_average
from fusetune.ekf2.filter.aid_sources.drag.drag_memory import drag_accumulator
from fusetune.ekf2.filter.aid_sources.external_vision import (
    ev_attitude_error,
    ev_control,
    ev_vel_control,
    ev_yaw_control,
    vision_by_mask,
)
from fusetune.ekf2.filter.aid_sources.optical_flow import (
    flow_over_terrain,
    integrated_flow,
    integrated_flow_at_once,
    optical_flow_fusion,
)
from fusetune.ekf2.filter.aid_sources.range_finder import range_for_height, range_height_control
from fusetune.ekf2.filter.aid_sources.sideslip import sideslip_fusion
from fusetune.ekf2.filter.common import aid_source_status
from fusetune.ekf2.filter.common.conditions import follow_system_flags_at_once, get_hagl, is_terrain_estimate_valid
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_RANGE
from fusetune.ekf2.filter.common.state import ATTITUDE, POSITION, TERRAIN, VELOCITY, WIND
from fusetune.ekf2.filter.resets import state_resets
from fusetune.ekf2.filter.terrain_filter import (
    terrain_by_flow,
    terrain_by_flow_axes,
    terrain_by_range,
    terrain_filter,
    terrain_in_air,
)
from fusetune.ekf2.numerics.rotations import quat_to_dcm
from fusetune.ekf2.replay import flight_schedule
from fusetune.ekf2.replay.recording import views_of
from fusetune.ekf2.schedule.sensor_actions import ACTION, BUFFERED, DUE
from fusetune.ekf2.schedule.taking_actions import BARO, GNSS, SYSTEM_FLAGS

V115 = "v1.15"
V114 = "v1.14"
V113 = "v1.13"
UNTIL_V115 = [(V115, True), (V116, False)]
UNTIL_V114 = [(V114, True), (V115, False)]
UNTIL_V113 = [(V113, True), (V114, False)]


def over_terrain(release: str = V115, **overrides: float) -> Flying:
    """10 m above a terrain that its filter knows to 0.5 m, moving at 3 m/s north and 4 m/s east."""
    it = flying(release, **overrides)
    it.ekf["vel"] = 3.0, 4.0, 0.0
    it.ekf["terrain_filter"]["variance"] = 0.25
    return it


def distance(it: Flying, metres: float) -> None:
    """Give the range finder a healthy sample, looking down."""
    rng = it.ekf["range"]
    rng["sample"]["range"], rng["sample"]["time_us"] = metres, it.ekf["time_delayed_us"]
    rng["cos_tilt"] = 1.0
    rng["is_sample_ready"] = rng["is_sample_valid"] = rng["is_regularly_sending_data"] = True


def pitched(it: Flying, angle: float) -> np.ndarray:
    it.ekf["q"] = math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0
    quat_to_dcm(it.ekf["q"], it.ekf["R_to_earth"])
    return np.asarray(it.ekf["R_to_earth"])


@pytest.mark.parametrize(("release", "as_judged"), UNTIL_V115)
def test_a_reset_keeps_the_innovation_and_a_stop_forgets_it(release, as_judged):
    it = flying(release)
    aid = it.ekf["aid"]["ev_pos"]
    aid["innovation"], aid["innovation_variance"], aid["observation_variance"] = 0.5, 0.4, 0.3
    aid["innovation_rejected"], aid["timestamp_sample"] = True, START_US
    asked(aid_source_status.reset_aid_source_status_zero_innovation, it, aid, 2)
    assert aid["time_last_fuse"] == START_US
    assert aid["fused"] != as_judged
    assert aid["innovation"][:2].tolist() == ([0.5, 0.5] if as_judged else [0.0, 0.0])
    asked(aid_source_status.forget_aid_source_status, it, aid, 2)
    assert (aid["timestamp_sample"] == 0) == as_judged
    assert aid["time_last_fuse"] == START_US


def test_the_rows_of_the_terrain_are_recorded_behind_those_of_v1_16():
    old, new = flying(V115), flying(V116)
    names = old.ekf["aid"].dtype.names
    assert names[: len(new.ekf["aid"].dtype.names)] == new.ekf["aid"].dtype.names
    assert names[-2:] == ("terrain_range_finder", "terrain_optical_flow")
    from fusetune.ekf2.filter.estimator import ekf_record

    assert len(views_of(np.zeros(1, ekf_record(V115))).aids) == len(names)


def test_the_terrain_grows_uncertain_by_height_and_slope():
    it = over_terrain(EKF2_TERR_NOISE=5.0, EKF2_TERR_GRAD=0.5)
    terrain_filter._predict.py_func(it.ekf, it.params)
    # per update of 10 ms: (0.01·5)² of the height, (0.01·0.5)²·5² of the slope
    assert it.ekf["terrain_filter"]["variance"] == pytest.approx(0.25 + 0.0025 + 0.000625)


def test_the_terrain_starts_below_the_vehicle_at_take_off(monkeypatch):
    it = over_terrain(EKF2_MIN_RNG=0.1)
    for part in ("control_terrain_by_range", "control_terrain_by_flow"):
        monkeypatch.setattr(terrain_filter, part, lambda *_: None)
    it.ekf["cs_prev"]["in_air"] = False
    asked(terrain_filter.run_terrain_filter, it, it.params)
    assert it.ekf["terrain"] == pytest.approx(-10.0 + 0.1)
    assert it.ekf["terrain_filter"]["variance"] == pytest.approx(0.01, rel=0.5)
    # and never comes closer than that
    it.ekf["cs_prev"]["in_air"] = True
    it.ekf["gpos_alt"] = 9.0
    asked(terrain_filter.run_terrain_filter, it, it.params)
    assert get_hagl(it.ekf) == pytest.approx(0.1)


def test_the_terrain_is_known_for_five_seconds_after_it_was_aided():
    it = over_terrain()
    it.ekf["aid"]["terrain_range_finder"]["time_last_fuse"] = START_US - 4_000_000
    assert not asked(is_terrain_estimate_valid, it)
    it.ekf["terrain_filter"]["uses_range"] = True
    assert asked(is_terrain_estimate_valid, it)
    set_time(it.ekf, START_US + 1_500_000)
    assert not asked(is_terrain_estimate_valid, it)
    it.ekf["aid"]["terrain_optical_flow"]["time_last_fuse"] = START_US
    it.ekf["terrain_filter"]["uses_flow"] = True
    assert asked(is_terrain_estimate_valid, it)


def test_a_distance_corrects_the_terrain_as_one_state():
    it = over_terrain(EKF2_RNG_NOISE=0.5, EKF2_RNG_SFE=0.0, EKF2_RNG_GATE=5.0)
    distance(it, 11.0)
    it.ekf["terrain_filter"]["uses_range"] = True
    terrain_by_range.control_terrain_by_range(it.ekf, it.params)
    aid = it.ekf["aid"]["terrain_range_finder"]
    # variances of 0.25 m² of either: the gain is a half
    assert aid["innovation"][0] == pytest.approx(-1.0)
    assert aid["innovation_variance"][0] == pytest.approx(0.5)
    assert it.ekf["terrain"] == pytest.approx(0.5)
    assert it.ekf["terrain_filter"]["variance"] == pytest.approx(0.125)
    assert aid["fused"]


def test_a_distance_that_fails_for_ten_seconds_is_taken_over_or_given_up():
    it = over_terrain(EKF2_RNG_NOISE=0.1, EKF2_RNG_SFE=0.0, EKF2_MIN_RNG=0.1)
    distance(it, 30.0)
    it.ekf["terrain_filter"]["uses_range"] = True
    it.ekf["aid"]["terrain_range_finder"]["time_last_fuse"] = START_US - 9_000_000
    terrain_by_range.control_terrain_by_range(it.ekf, it.params)
    assert it.ekf["terrain"] == 0.0
    set_time(it.ekf, START_US + 2_000_000)
    terrain_by_range.control_terrain_by_range(it.ekf, it.params)
    assert it.ekf["terrain"] == pytest.approx(20.0)
    # what sees its own feet is at fault, if it was good to start with
    distance(it, 0.1)
    it.ekf["aid"]["terrain_range_finder"]["time_last_fuse"] = START_US - 9_000_000
    terrain_by_range.control_terrain_by_range(it.ekf, it.params)
    assert it.ekf["cs"]["rng_fault"]
    assert not it.ekf["terrain_filter"]["uses_range"]
    asked(range_height_control._run_checks, it, it.params)
    assert not it.ekf["range"]["is_sample_valid"]


def test_flow_corrects_the_terrain_by_the_first_innovation_alone():
    it = over_terrain(EKF2_OF_GATE=3.0)
    it.ekf["P"][:] = 0.0
    aid, flow = it.ekf["aid"]["terrain_optical_flow"], it.ekf["sensors"]["flow"]["sample"]
    aid["observation_variance"][:2] = 0.01
    aid["observation"][:2] = 0.38, -0.3
    aid["innovation"][:2] = 0.4 - 0.38, -0.3 + 0.3
    flow["gyro_rate"] = 0.0
    terrain_by_flow._fuse.py_func(it.ekf, it.params)
    by_x = 4.0 / 10.0**2
    variance_x = 0.25 * by_x**2 + 0.01
    terrain, variance = 0.25 * by_x / variance_x * 0.02, 0.25 * (1.0 - 0.25 * by_x**2 / variance_x)
    by_y = -3.0 / 10.0**2
    variance_y = variance * by_y**2 + 0.01
    assert aid["innovation_variance"][:2] == pytest.approx((variance_x, variance_y))
    assert aid["innovation"][1] == pytest.approx(-3.0 / (10.0 + terrain) + 0.3)
    assert it.ekf["terrain"] == pytest.approx(terrain + variance * by_y / variance_y * 0.02)
    assert it.ekf["terrain_filter"]["variance"] == pytest.approx(variance * (1.0 - variance * by_y**2 / variance_y))


def test_flow_is_left_to_the_terrain_only_where_gnss_aids_and_the_main_filter_does_without(monkeypatch):
    it, fused = over_terrain(), []
    it.params["EKF2_TERR_MASK"] = 3.0
    monkeypatch.setattr(terrain_by_flow, "judge_flow", lambda *_: None)
    monkeypatch.setattr(terrain_by_flow, "_fuse", lambda *_: fused.append(True))

    def tried(mask: float = 3.0, **flags: bool) -> bool:
        for name, value in ({"gnss_pos": True, "opt_flow": False} | flags).items():
            it.ekf["cs"][name] = value
        it.params["EKF2_TERR_MASK"] = mask
        it.ekf["terrain_filter"]["flow_is_good"] = True
        fused.clear()
        terrain_by_flow.control_terrain_by_flow.py_func(it.ekf, it.params)
        assert it.ekf["terrain_filter"]["uses_flow"] == bool(fused)
        return bool(fused)

    assert tried()
    assert not tried(opt_flow=True)
    assert not tried(gnss_pos=False)
    assert not tried(mask=1.0)
    it.ekf["terrain_filter"]["uses_range"] = True
    assert not tried()


@pytest.mark.parametrize(("release", "kept"), UNTIL_V115)
def test_without_climb_the_verdict_on_the_range_finder_stays(release, kept, monkeypatch):
    it = flying(release)
    monkeypatch.setattr(range_height_control, "_compare_with_velocity", _find_inconsistent)
    for climb, expected in ((0.4, kept), (0.6, False)):
        it.ekf["range"]["is_kinematically_consistent"] = True
        it.ekf["vel"][2] = -climb
        chosen = range_height_control._compare_and_judge_in_climb.py_func if kept else _find_inconsistent
        chosen(it.ekf, it.params)
        assert it.ekf["range"]["is_kinematically_consistent"] == expected
    assert asked(range_height_control._check_consistency, it, it.params) is None


def _find_inconsistent(ekf, params):
    ekf["range"]["is_kinematically_consistent"] = False


@pytest.mark.parametrize(("release", "fog_seen"), [(V115, False), (V116, True)])
def test_fog_is_looked_for_since_v1_16(release, fog_seen, monkeypatch):
    it, distances = flying(release, EKF2_RNG_FOG=3.0), []
    monkeypatch.setattr(range_height_control, "run_range_sensor_checks", lambda *given: distances.append(given[-1]))
    asked(range_height_control._run_checks, it, it.params)
    assert distances == [3.0 if fog_seen else 0.0]


def ranging(**overrides: float) -> Flying:
    """A range finder that sees 10.5 m where the estimate has 10 m, with 2 m/s of nothing but time."""
    it = flying(V115, EKF2_RNG_NOISE=0.1, EKF2_RNG_SFE=0.0, **overrides)
    distance(it, 10.5)
    it.ekf["sensors"]["range"]["newest_time_us"] = START_US
    return it


def test_range_joins_other_heights_with_the_bias_that_makes_it_agree():
    it = ranging(EKF2_RNG_CTRL=2.0, EKF2_HGT_REF=0.0)
    range_for_height._use_sample.py_func(it.ekf, it.params)
    assert it.ekf["cs"]["rng_hgt"]
    assert it.ekf["rng_hgt_b_est"]["bias"] == pytest.approx(0.5)
    assert it.ekf["rng_hgt_b_est"]["fusion_active"]
    assert it.ekf["gpos_alt"] == 10.0
    range_for_height._use_sample.py_func(it.ekf, it.params)
    aid = it.ekf["aid"]["rng_hgt"]
    assert aid["observation"][0] == pytest.approx(-10.0)
    assert aid["observation_variance"][0] == pytest.approx(0.01, rel=1e-3)
    assert aid["fused"]


def test_range_that_leads_makes_the_ground_the_datum():
    it = ranging(EKF2_RNG_CTRL=2.0, EKF2_HGT_REF=2.0)
    it.ekf["rng_hgt_b_est"]["bias"] = 3.0
    range_for_height._use_sample.py_func(it.ekf, it.params)
    assert it.ekf["gpos_alt"] == pytest.approx(10.5)
    assert it.ekf["height_sensor_ref"] == HEIGHT_REF_RANGE
    assert it.ekf["rng_hgt_b_est"]["bias"] == 0.0
    # a height reset moves the terrain and the bias along
    assert it.ekf["terrain"] == pytest.approx(-0.5)
    state_resets.reset_altitude_to(it.ekf, it.params, 12.5, math.nan)
    assert it.ekf["rng_hgt_b_est"]["bias"] == pytest.approx(-2.0)


def test_conditional_range_leads_without_a_reset():
    it = ranging(EKF2_RNG_CTRL=1.0, EKF2_HGT_REF=2.0, EKF2_RNG_A_HMAX=20.0)
    aid = it.ekf["aid"]["terrain_range_finder"]
    it.ekf["terrain_filter"]["uses_range"], aid["time_last_fuse"] = True, START_US
    aid["innovation"][0], aid["innovation_variance"][0] = 0.01, 0.02
    range_for_height._use_sample.py_func(it.ekf, it.params)
    assert it.ekf["cs"]["rng_hgt"]
    assert it.ekf["height_sensor_ref"] == HEIGHT_REF_RANGE
    assert it.ekf["gpos_alt"] == 10.0
    assert it.ekf["rng_hgt_b_est"]["bias"] == pytest.approx(0.5)


def test_what_conditional_range_aid_asks_for():
    it = ranging(EKF2_RNG_A_HMAX=20.0, EKF2_RNG_A_VMAX=4.0, EKF2_RNG_A_IGATE=2.0)
    aid = it.ekf["aid"]["terrain_range_finder"]
    it.ekf["terrain_filter"]["uses_range"], aid["time_last_fuse"] = True, START_US
    it.ekf["cs"]["gnss_pos"] = True
    suitable = range_for_height.is_low_and_slow
    # the ratio 0.1²/(2²·0.5) = 0.005 starts, 0.4²/(2²·0.5) = 0.08 does not but goes on
    aid["innovation"][0], aid["innovation_variance"][0] = 0.1, 0.5
    assert suitable(it.ekf, it.params)
    aid["innovation"][0] = 0.4
    assert not suitable(it.ekf, it.params)
    it.ekf["cs"]["rng_hgt"] = True
    assert suitable(it.ekf, it.params)
    it.ekf["vel"][:2] = 3.0, 2.7
    assert not suitable(it.ekf, it.params)
    it.ekf["vel"][:2] = 0.0
    it.ekf["terrain"] = 10.0
    assert not suitable(it.ekf, it.params)
    it.ekf["terrain"] = 0.0
    aid["time_last_fuse"] = START_US - 6_000_000
    assert not suitable(it.ekf, it.params)


def test_range_that_fails_alone_is_at_fault_and_with_all_others_resets_the_height():
    it = ranging(EKF2_RNG_CTRL=2.0, EKF2_HGT_REF=0.0)
    range_for_height._use_sample.py_func(it.ekf, it.params)
    distance(it, 30.0)
    it.ekf["aid"]["rng_hgt"]["innovation_rejected"] = True
    it.ekf["aid"]["rng_hgt"]["time_last_fuse"] = it.ekf["time_last_hgt_fuse"] = START_US - 6_000_000
    range_for_height._fuse_or_recover.py_func(it.ekf, it.params, 30.0)
    assert it.ekf["gpos_alt"] == pytest.approx(29.5)
    it.ekf["aid"]["rng_hgt"]["time_last_fuse"] = START_US - 6_000_000
    range_for_height._fuse_or_recover.py_func(it.ekf, it.params, 30.0)
    assert it.ekf["cs"]["rng_fault"]
    assert not it.ekf["cs"]["rng_hgt"]


def flow_of(it: Flying, x: float, y: float, quality: int = 255) -> None:
    sample = it.ekf["sensors"]["flow"]["sample"]
    sample["flow_rate"], sample["gyro_rate"] = (x, y), (0.0, 0.0, 0.0)
    sample["quality"], sample["time_us"] = quality, it.ekf["time_delayed_us"]
    it.ekf["sensors"]["flow"]["data_ready"] = True


@pytest.mark.parametrize(("release", "least"), [(V115, 0.1), (V116, 0.01)])
def test_the_flow_sensor_is_as_high_as_on_the_ground(release, least):
    it = flying(release, EKF2_MIN_RNG=0.1)
    it.ekf["terrain"] = -9.995
    assert asked(optical_flow_fusion.predict_flow_hagl, it, it.params) == pytest.approx(least)


def test_the_flow_gyro_is_compensated_raw_and_its_bias_told_with_the_bias_of_the_imu():
    it = over_terrain()
    flow_of(it, 0.5, 0.2)
    it.ekf["sensors"]["flow"]["sample"]["gyro_rate"] = 0.1, 0.0, math.nan
    it.ekf["imu_delayed"]["delta_ang"] = 0.001, 0.0, 0.002
    it.ekf["gyro_bias"] = 0.02, 0.0, 0.0
    flow_over_terrain._compensate_body_rate.py_func(it.ekf)
    flow = it.ekf["flow"]
    # -0.1 rad/s of the IMU, less its bias of 0.02 rad/s once more
    assert flow["ref_body_rate"] == pytest.approx((-0.12, 0.0, -0.2))
    assert flow["rate_compensated"] == pytest.approx((0.4, 0.2))
    assert flow["gyro_bias"] == pytest.approx((0.001, 0.0, 0.0))  # at most 0.1 rad/s, by a hundredth
    assert it.ekf["sensors"]["flow"]["sample"]["gyro_rate"][2] == pytest.approx(-0.2)


def test_flow_is_predicted_and_differentiated_at_the_distance_that_is_given():
    it = over_terrain(EKF2_OF_N_MIN=0.1, EKF2_OF_N_MAX=0.1)
    R = pitched(it, 0.2)
    flow_of(it, 0.0, 0.0)
    flow_over_terrain.judge_flow(it.ekf, it.params, it.ekf["aid"]["optical_flow"])
    along = R.T @ np.array([3.0, 4.0, 0.0])
    at = 10.0 / R[2, 2]
    aid = it.ekf["aid"]["optical_flow"]
    assert aid["innovation"][:2] == pytest.approx((along[1] / at, -along[0] / at))
    H = np.array(it.ekf["flow"]["H"])
    assert H[0, VELOCITY : VELOCITY + 3] == pytest.approx(R[:, 1] / at)
    assert H[1, VELOCITY : VELOCITY + 3] == pytest.approx(-R[:, 0] / at)
    assert H[0, ATTITUDE : ATTITUDE + 3] == pytest.approx(np.cross(R[:, 1], (3.0, 4.0, 0.0)) / at)
    assert H[:, POSITION + 2].tolist() == H[:, TERRAIN].tolist() == [0.0, 0.0]
    assert aid["innovation_variance"][0] == pytest.approx(0.01 * H[0] @ H[0] + 0.01)


def test_flow_of_low_quality_fast_or_tilted_is_left_out():
    it = over_terrain(EKF2_OF_QMIN=10.0, EKF2_OF_QMIN_GND=50.0)
    good = flow_over_terrain._is_sample_good
    it.ekf["flow"]["max_rate"] = 2.0
    flow_of(it, 1.0, 1.0, quality=20)
    assert good(it.ekf, it.params)
    it.ekf["cs"]["in_air"] = False
    assert not good(it.ekf, it.params)
    it.ekf["cs"]["in_air"] = True
    flow_of(it, 1.5, 1.5, quality=20)
    assert not good(it.ekf, it.params)
    flow_of(it, 1.0, 1.0, quality=20)
    pitched(it, math.radians(46.0))
    assert not good(it.ekf, it.params)


def test_flow_starts_with_the_velocity_of_its_sample_and_the_position_of_the_ground():
    it = over_terrain(EKF2_OF_N_MIN=0.2, EKF2_OF_N_MAX=0.2)
    it.ekf["cs"]["in_air"] = False
    it.ekf["flow"]["vel_body"] = 1.0, -2.0
    flow_of(it, 0.0, 0.0)
    flow_over_terrain._start_flow.py_func(it.ekf, it.params)
    assert it.ekf["cs"]["opt_flow"]
    assert it.ekf["vel"][:2] == pytest.approx((1.0, -2.0))
    assert it.ekf["P"][VELOCITY, VELOCITY] == pytest.approx(0.04)  # that of the rate, whatever the distance
    assert it.ekf["state_reset"]["pos_ne_counter"] == 1
    assert it.ekf["aid"]["optical_flow"]["time_last_fuse"] == START_US


@pytest.mark.parametrize(("release", "gain"), [(V115, 0.001), (V116, 0.01 / 10.01)])
def test_the_rotation_of_vision_is_filtered_by_a_thousandth(release, gain):
    assert asked(ev_attitude_error._filter_gain, flying(release)) == pytest.approx(gain, rel=1e-12)


def vision_of(it: Flying, frame: int, velocity: tuple[float, float, float]) -> None:
    vision = it.ekf["sensors"]["ev"]["sample"]
    vision["vel"], vision["velocity_var"], vision["vel_frame"] = velocity, (0.01, 0.04, 0.09), frame
    vision["time_us"] = START_US


def test_velocity_of_vision_in_the_body_is_turned_and_fused_along_north_east_and_down():
    it = over_terrain(EKF2_EVV_NOISE=0.05)
    R = pitched(it, math.pi / 2)
    vision_of(it, EV_FRAME_BODY_FRD, (1.0, 2.0, 3.0))
    ev_vel_control._turn_measurement(it.ekf, it.params)
    ev_vel_control._judge_along_axes(it.ekf, it.params)
    assert it.ekf["ev"]["vel_measurement"] == pytest.approx(R @ (1.0, 2.0, 3.0))
    assert it.ekf["ev"]["vel_measurement_var"] == pytest.approx((0.09, 0.04, 0.01))
    aid = it.ekf["aid"]["ev_vel"]
    assert aid["timestamp_sample"] == START_US
    assert aid["innovation"] == pytest.approx((3.0 - 3.0, 4.0 - 2.0, 0.0 + 1.0))
    assert aid["innovation_variance"] == pytest.approx((0.1, 0.05, 0.02))


def test_velocity_of_vision_is_as_uncertain_as_its_attitude_and_as_gnss():
    it = over_terrain(EKF2_EVV_NOISE=0.05, EKF2_GPS_V_NOISE=0.5)
    it.ekf["ev"]["q_error_filt"] = 1.0, 0.0, 0.0, 0.0
    it.ekf["sensors"]["ev"]["sample"]["orientation_var"] = 0.02, 0.03, 0.01
    vision_of(it, EV_FRAME_FRD, (1.0, 2.0, 3.0))
    ev_vel_control._turn_measurement(it.ekf, it.params)
    assert it.ekf["ev"]["vel_measurement_var"] == pytest.approx((0.03, 0.04, 0.09))
    it.ekf["cs"]["gnss_vel"] = it.ekf["cs"]["gnss_pos"] = True
    ev_vel_control._turn_measurement(it.ekf, it.params)
    assert it.ekf["ev"]["vel_measurement_var"] == pytest.approx((0.25, 0.25, 0.09))
    vision_of(it, EV_FRAME_NED, (1.0, 2.0, 3.0))
    ev_vel_control._turn_measurement(it.ekf, it.params)
    assert np.isnan(it.ekf["ev"]["vel_measurement"]).all()


@pytest.mark.parametrize(("ratio", "starts"), [(0.09, True), (0.11, False)])
def test_velocity_of_vision_joins_only_where_it_agrees(ratio, starts, monkeypatch):
    it = over_terrain(EKF2_EV_CTRL=4.0)
    monkeypatch.setattr(ev_vel_control, "_judge_along_axes", lambda *_: None)
    it.ekf["cs"]["opt_flow"] = True
    it.ekf["aid"]["ev_vel"]["test_ratio"] = 0.01, ratio, 0.01
    vision_of(it, EV_FRAME_BODY_FRD, (1.0, 2.0, 3.0))
    asked(ev_vel_control.control_ev_vel_fusion, it, it.params, True, False, True)
    assert it.ekf["cs"]["ev_vel"] == starts
    assert it.ekf["state_reset"]["vel_ne_counter"] == 0


@pytest.mark.parametrize(("release", "unjudged"), UNTIL_V115)
def test_yaw_of_vision_joins_an_aligned_one_without_being_fused(release, unjudged, monkeypatch):
    it = flying(release, EKF2_EV_CTRL=8.0)
    monkeypatch.setattr(ev_yaw_control, "fuse_yaw", lambda *_: False)
    it.ekf["sensors"]["ev"]["sample"]["quat"] = 1.0, 0.0, 0.0, 0.0
    it.ekf["sensors"]["ev"]["sample"]["pos_frame"] = EV_FRAME_NED
    it.ekf["cs"]["yaw_align"] = True
    asked(ev_yaw_control._update_ev_yaw, it, it.params)
    assert (it.ekf["aid"]["ev_yaw"]["innovation_variance"][0] == 0.0) == unjudged
    assert bool(asked(ev_yaw_control._join_yaw, it, it.params)) == unjudged
    assert (it.ekf["aid"]["ev_yaw"]["time_last_fuse"] == START_US) == unjudged


@pytest.mark.parametrize(("release", "wings_only"), UNTIL_V115)
def test_air_data_are_those_of_a_fixed_wing(release, wings_only):
    it = flying(release)
    it.ekf["cs"]["fuse_aspd"] = True
    assert bool(asked(airspeed_control._may_have_airspeed, it)) != wings_only
    assert bool(asked(sideslip_fusion._may_have_sideslip, it)) != wings_only
    set_time(it.ekf, START_US + INTERVAL_US)
    asked(airspeed_fusion._count_as_velocity, it)
    assert (it.ekf["time_last_hor_vel_fuse"] == START_US) == wings_only


@pytest.mark.parametrize(("release", "forgotten"), UNTIL_V115)
def test_drag_starts_with_no_wind(release, forgotten):
    it = flying(release)
    it.ekf["wind_vel"] = 3.0, -2.0
    asked(wind.start_wind, it)
    assert it.ekf["wind_vel"].tolist() == ([0.0, 0.0] if forgotten else [3.0, -2.0])
    assert it.ekf["P"][WIND, WIND] == 1.0


def test_sideslip_starts_the_wind_and_is_fused_then(monkeypatch):
    it, seen = flying(V115), []
    monkeypatch.setattr(sideslip_fusion, "_fuse_sideslip", lambda ekf, params: seen.append(ekf.wind_vel.tolist()))
    it.ekf["wind_vel"] = 3.0, -2.0
    asked(sideslip_fusion._use_sideslip, it, it.params)
    assert seen == [[0.0, 0.0]]
    assert it.ekf["cs"]["wind"]
    assert it.ekf["aid"]["sideslip"]["time_last_fuse"] == START_US


@pytest.mark.parametrize(("release", "ratio"), UNTIL_V115)
def test_sideslip_is_a_ratio(release, ratio):
    it = flying(release, EKF2_BETA_NOISE=0.001)
    it.ekf["vel"] = 10.0, 4.0, 0.0
    it.ekf["wind_vel"] = 2.0, 0.0
    assert asked(sideslip_fusion.predict_sideslip, it) == pytest.approx(0.5 if ratio else math.atan(0.5), rel=1e-3)
    H = np.zeros(24)
    sideslip_fusion.compute_sideslip_jacobian(it.ekf, H)
    # of b/a: -b/a², 1/a; of atan2(b, a): those over 1 + (b/a)²
    shared = 1.0 if ratio else 1.25
    assert H[VELOCITY : VELOCITY + 2] == pytest.approx((-4.0 / 64.0 / shared, 1.0 / 8.0 / shared), rel=1e-3)
    assert H[WIND : WIND + 2] == pytest.approx(-H[VELOCITY : VELOCITY + 2])
    assert H[ATTITUDE + 2] == pytest.approx(-1.25 / shared, rel=1e-3)
    assert asked(sideslip_fusion._sideslip_noise, it, it.params) == pytest.approx(1e-6 if ratio else 1e-4)


@pytest.mark.parametrize(("release", "both"), UNTIL_V115)
def test_drag_counts_as_fused_where_both_axes_were(release, both):
    it = flying(release)
    assert bool(asked(drag_fusion._counts_as_fused, it, False)) != both
    assert asked(drag_fusion._counts_as_fused, it, True)


@pytest.mark.parametrize(("release", "in_air_only"), UNTIL_V114)
def test_the_terrain_is_seen_on_the_ground_since_v1_15(release, in_air_only, monkeypatch):
    it = over_terrain(release, EKF2_MIN_RNG=0.1)
    monkeypatch.setattr(terrain_filter, "control_terrain_by_flow", lambda *_: None)
    it.ekf["cs"]["in_air"] = False
    it.ekf["aid"]["terrain_range_finder"]["time_last_fuse"] = START_US - 500_000
    terrain_filter._hold_on_ground.py_func(it.ekf, it.params)
    assert it.ekf["terrain"] == (pytest.approx(-9.9) if in_air_only else 0.0)
    # and at take-off v1.15 starts it anew
    it.ekf["terrain"], it.ekf["cs"]["in_air"], it.ekf["cs_prev"]["in_air"] = 0.0, True, False
    asked(terrain_filter._take_off, it, it.params)
    assert it.ekf["terrain"] == (0.0 if in_air_only else pytest.approx(-9.9))


def test_range_of_v1_14_corrects_the_terrain_in_the_air_and_publishes_nothing():
    it = over_terrain(V114, EKF2_RNG_NOISE=0.5, EKF2_RNG_SFE=0.0, EKF2_RNG_GATE=5.0)
    distance(it, 11.0)
    aid, terrain = it.ekf["aid"]["terrain_range_finder"], it.ekf["terrain_filter"]
    terrain_in_air.control_terrain_in_air(it.ekf, it.params)
    assert terrain["uses_range"]
    assert it.ekf["terrain"] == pytest.approx(1.0)  # it starts with the distance, as uncertain as that is
    assert terrain["variance"] == pytest.approx(0.25)
    distance(it, 12.0)
    terrain_in_air.control_terrain_in_air(it.ekf, it.params)
    assert it.ekf["terrain"] == pytest.approx(1.5)
    assert aid["timestamp_sample"] == 0
    it.ekf["cs"]["in_air"] = False
    terrain_in_air.control_terrain_in_air(it.ekf, it.params)
    assert not terrain["uses_range"]
    assert aid["innovation"][0] == 0.0
    assert not is_terrain_estimate_valid.of(V114).py_func(it.ekf)


def test_range_of_v1_14_joins_flow_where_they_agree():
    it = over_terrain(V114, EKF2_RNG_NOISE=0.5, EKF2_RNG_SFE=0.0, EKF2_RNG_GATE=5.0)
    # the innovation variance is 0.5 m²: 1² / (5²·0.5) = 0.08, 2² / (5²·0.5) = 0.32
    for measured, agrees in ((11.0, True), (12.0, False)):
        distance(it, measured)
        assert terrain_in_air._agrees(it.ekf, it.params) == agrees


@pytest.mark.parametrize(("release", "left"), UNTIL_V114)
def test_a_height_reset_moves_the_terrain_since_v1_15(release, left):
    it = flying(release)
    asked(state_resets._move_terrain, it, -2.0)
    assert it.ekf["terrain"] == (0.0 if left else -2.0)


def integrated(**overrides: float) -> Flying:
    """A sample of flow of v1.14: 0.02 s in which the image turned 0.01 rad, and the IMU was summed up as long."""
    it = over_terrain(V114, EKF2_OF_QMIN=10.0, EKF2_OF_QMIN_GND=10.0, **overrides)
    it.ekf["flow"]["max_rate"] = 5.0
    it.ekf["flow_interval"] = 0.02
    flow_of(it, 0.5, -0.25)
    it.ekf["sensors"]["flow"]["sample"]["gyro_rate"] = 0.05, 0.0, 0.0
    integrated_flow.integrate_sample.py_func(it.ekf)
    memory = it.ekf["flow_integrals"]
    memory["imu_time"] = 0.02
    memory["imu_angle"] = 0.001, 0.0, 0.0
    it.ekf["terrain_filter"]["flow_is_good"] = True
    return it


def test_integrals_of_flow_are_compensated_by_the_gyro_less_its_bias():
    it = integrated()
    integrated_flow._prepare_sample.py_func(it.ekf, it.params)
    # the gyro reads 0.05 rad/s, the IMU 0.05 rad/s the other way round: PX4 takes their difference of 0 for the bias
    assert it.ekf["flow_integrals"]["gyro_bias"] == pytest.approx((0.0, 0.0, 0.0))
    assert it.ekf["flow"]["rate_compensated"] == pytest.approx((0.45, -0.25))
    assert it.ekf["flow_integrals"]["imu_time"] == 0.0
    it = integrated()
    it.ekf["flow_integrals"]["imu_angle"] = -0.001, 0.0, 0.0
    integrated_flow._prepare_sample.py_func(it.ekf, it.params)
    assert it.ekf["flow_integrals"]["gyro_bias"][0] == pytest.approx(0.01 * 0.1)
    assert it.ekf["flow"]["rate_compensated"][0] == pytest.approx(0.5 - (0.05 - 0.001))


def test_flow_without_a_gyro_takes_the_imu():
    it = integrated()
    it.ekf["flow_integrals"]["gyro"] = math.nan
    integrated_flow._prepare_sample.py_func(it.ekf, it.params)
    assert it.ekf["flow"]["rate_compensated"] == pytest.approx((0.5 + 0.05, -0.25))


@pytest.mark.parametrize("in_air", [True, False])
def test_bad_flow_is_left_out_in_the_air_and_counts_as_none_on_the_ground(in_air):
    it = integrated()
    it.ekf["cs"]["in_air"] = in_air
    it.ekf["sensors"]["flow"]["sample"]["quality"] = 5
    integrated_flow._prepare_sample.py_func(it.ekf, it.params)
    assert it.ekf["flow"]["rate_compensated"].tolist() == [0.0, 0.0]
    assert it.ekf["terrain_filter"]["flow_is_good"] != in_air


def test_an_interval_of_flow_far_from_that_of_the_imu_begins_it_anew():
    it = integrated()
    it.ekf["imu_delayed"]["delta_ang"] = 0.002, 0.0, 0.0
    assert integrated_flow._is_interval_good.py_func(it.ekf, 0.014, 0.026)
    it.ekf["flow_integrals"]["imu_time"] = 0.1
    assert integrated_flow._is_interval_good.py_func(it.ekf, 0.07, 0.13)
    assert it.ekf["flow_integrals"]["imu_time"] == 0.01
    assert it.ekf["flow_integrals"]["imu_angle"][0] == pytest.approx(0.002)
    it.ekf["flow_integrals"]["sample_time"] = 0.15
    assert not integrated_flow._is_interval_good.py_func(it.ekf, 0.07, 0.13)


@pytest.mark.parametrize(("release", "gain"), UNTIL_V114)
def test_the_rotation_of_vision_is_that_of_the_sample(release, gain):
    it = flying(release)
    pitched(it, 0.3)
    it.ekf["sensors"]["ev"]["sample"]["quat"] = 1.0, 0.0, 0.0, 0.0
    it.ekf["ev"]["q_error_filt"] = 1.0, 0.0, 0.0, 0.0
    asked(ev_attitude_error.refresh_ev_rotation, it)
    assert it.ekf["ev"]["R_ev_to_ekf"][0, 0] == pytest.approx(math.cos(0.3) if gain else 1.0)


def test_wind_by_airspeed_is_as_uncertain_as_a_heading_of_ten_degrees(monkeypatch):
    it = flying(V114, EKF2_EAS_NOISE=1.0)
    it.ekf["sensors"]["airspeed"]["sample"]["true_airspeed"] = 10.0
    it.ekf["sensors"]["airspeed"]["sample"]["eas2tas"] = 1.0
    it.ekf["wind_vel"] = 3.0, 2.0
    monkeypatch.setattr(airspeed_resets, "reset_covariance_block", lambda ekf, *_: ekf["P"].__setitem__(22, 0.0))
    asked(airspeed_resets._reset_wind_covariance, it, it.params, 10.0, 1.0, 0.0)
    yaw, slip = math.radians(10.0) ** 2, (10.0 * math.sin(math.radians(15.0))) ** 2
    P = it.ekf["P"]
    assert P[WIND, WIND] == pytest.approx(1.0 + yaw * 4.0 + 0.01)
    assert P[WIND + 1, WIND + 1] == pytest.approx(yaw * 9.0 + slip + 0.01)
    assert P[WIND, WIND + 1] == pytest.approx(yaw * -2.0 * 3.0)


@pytest.mark.parametrize(("release", "wind_only"), UNTIL_V114)
def test_airspeed_does_not_set_the_velocity_until_v1_15(release, wind_only):
    it = flying(release)
    it.ekf["cs"]["inertial_dead_reckoning"] = True
    assert bool(asked(airspeed_control._may_reset_velocity, it)) != wind_only


@pytest.mark.parametrize(("release", "fast_only"), UNTIL_V114)
def test_sideslip_is_fused_at_speed(release, fast_only):
    it = flying(release)
    it.ekf["vel"][:2] = 6.0, 3.0
    assert asked(sideslip_fusion._is_fast_enough, it) == (not fast_only or math.hypot(6.0, 3.0) > 7.0)
    it.ekf["wind_vel"] = -4.0, 0.0
    assert asked(sideslip_fusion._is_fast_enough, it)


@pytest.mark.parametrize(("release", "in_air_only"), UNTIL_V114)
def test_drag_is_judged_in_the_air(release, in_air_only):
    it = flying(release)
    it.ekf["cs"]["in_air"] = False
    assert bool(asked(drag_fusion._is_drag_judged, it)) != in_air_only


def test_flow_is_asked_for_whatever_the_main_filter_uses_until_v1_15():
    asking = flight_schedule._asking_parameter
    assert asking("flow", V115) is None
    assert asking("flow", V116)[0] == "EKF2_OF_CTRL"
    assert asking("airspeed", V115)[0] == "EKF2_ARSP_THR"
    assert asking("gnss", V114)[0] == "EKF2_GPS_CTRL"
    assert asking("gnss", V113) is None
    name, asks = asking("drag", V113)
    assert name == "EKF2_AID_MASK"
    assert (asks(32.0), asks(31.0)) == (1.0, 0.0)


@pytest.mark.parametrize(("release", "keeps_north"), [(V115, True), (V114, False)])
def test_vision_that_knows_no_north_leaves_no_other_yaw_beside_it_until_v1_15(release, keeps_north):
    it = flying(release)
    it.ekf["sensors"]["ev"]["sample"]["pos_frame"] = EV_FRAME_FRD
    for flag in ("ev_yaw", "mag_hdg", "gnss_yaw", "gnss_pos", "gnss_vel"):
        it.ekf["cs"][flag] = True
    asked(ev_control._give_north_up, it, it.params, True)
    assert it.ekf["cs"]["gnss_pos"]
    asked(ev_control._give_north_up, it, it.params, False)
    for flag in ("mag_hdg", "gnss_yaw", "gnss_pos", "gnss_vel"):
        assert it.ekf["cs"][flag] == keeps_north


def test_flow_of_v1_13_corrects_the_terrain_axis_by_axis():
    it = over_terrain(V113, EKF2_OF_GATE=3.0, EKF2_OF_N_MIN=0.1, EKF2_OF_N_MAX=0.1)
    it.ekf["cs"]["gnss_pos"] = it.ekf["cs"]["gnss_vel"] = True
    it.params["EKF2_TERR_MASK"] = 3.0
    flow_of(it, 0.0, 0.0)
    it.ekf["terrain_filter"]["flow_is_good"] = True
    # 4 m/s to the right over 10 m turn the image by 0.4 rad/s; the other axis is off by more than the gate
    it.ekf["flow"]["rate_compensated"] = 0.38, 0.7
    terrain_by_flow_axes.control_terrain_by_flow_axes(it.ekf, it.params)
    by_terrain = 4.0 / 10.0**2
    variance = 0.25 * by_terrain**2 + 0.01
    aid = it.ekf["aid"]["terrain_optical_flow"]
    assert aid["innovation"][:2] == pytest.approx((0.02, -0.3 - 0.7))
    assert aid["innovation_variance"][0] == pytest.approx(variance)
    assert it.ekf["terrain"] == pytest.approx(0.25 * by_terrain / variance * 0.02)
    assert it.ekf["terrain_filter"]["variance"] == pytest.approx(0.25 * (1.0 - 0.25 * by_terrain**2 / variance))
    assert it.ekf["terrain_filter"]["uses_flow"]
    it.ekf["aid"]["terrain_range_finder"]["time_last_fuse"] = START_US
    it.ekf["terrain_filter"]["flow_is_good"] = True
    terrain_by_flow_axes.control_terrain_by_flow_axes(it.ekf, it.params)
    assert not it.ekf["terrain_filter"]["uses_flow"]


@pytest.mark.parametrize(("release", "slow_only"), UNTIL_V113)
def test_distances_are_compared_with_the_climb_in_slow_flight(release, slow_only, monkeypatch):
    it, compared = flying(release), []
    monkeypatch.setattr(range_height_control, "_compare_with_velocity", lambda *_: compared.append(True))
    monkeypatch.setattr(range_height_control, "_compare_and_judge_in_climb", lambda *_: compared.append(True))
    if slow_only:
        for speed, wings, expected in ((0.2, False, 1), (0.4, False, 0), (0.2, True, 0)):
            compared.clear()
            it.ekf["vel"], it.ekf["cs"]["fixed_wing"] = (speed, 0.0, 0.0), wings
            range_height_control._compare_in_slow_flight.py_func(it.ekf, it.params)
            assert len(compared) == expected
    it.ekf["cs"]["in_air"], it.ekf["cs"]["vehicle_at_rest"] = False, True
    assert bool(asked(range_height_control._may_stand, it)) != slow_only


def seen(mask: float, **overrides: float) -> Flying:
    """Vision of v1.13, at (2, 1) m with a velocity of (1, 2, 3) m/s and turned 90° to the left of the estimate."""
    it = flying(V113, EKF2_EVP_GATE=100.0, EKF2_EVV_GATE=100.0, **overrides)
    it.params["EKF2_AID_MASK"] = mask
    it.ekf["vel"] = 1.0, 2.0, 3.0
    sample = it.ekf["sensors"]["ev"]["sample"]
    sample["pos"], sample["position_var"] = (2.0, 1.0, -10.0), (0.3, 0.4, 0.5)
    sample["quat"] = math.sqrt(0.5), 0.0, 0.0, -math.sqrt(0.5)
    sample["orientation_var"] = 0.01, 0.01, 1e-6
    vision_of(it, EV_FRAME_FRD, (1.0, 2.0, 3.0))
    it.ekf["sensors"]["ev"]["data_ready"] = True
    it.ekf["sensors"]["ev"]["newest_time_us"] = it.ekf["time_latest_us"]
    it.ekf["cs"]["tilt_align"] = it.ekf["cs"]["yaw_align"] = True
    it.ekf["time_last_hor_pos_fuse"] = it.ekf["time_last_hor_vel_fuse"] = START_US
    return it


def test_the_mask_says_what_of_vision_is_fused():
    it = seen(8.0)
    asked(ev_control.control_external_vision_fusion, it, it.params)
    flags = ("ev_pos", "ev_vel", "ev_yaw")
    assert [bool(it.ekf["cs"][name]) for name in flags] == [True, False, False]
    # it starts with a reset, and is fused then
    assert it.ekf["state_reset"]["pos_ne_counter"] == 1
    aid = it.ekf["aid"]["ev_pos"]
    assert aid["innovation"][:2] == pytest.approx((0.0, 0.0), abs=1e-9)
    assert aid["observation_variance"][:2] == pytest.approx((0.3, 0.4))
    assert aid["fused"]
    it = seen(8.0 + 64.0)
    asked(ev_control.control_external_vision_fusion, it, it.params)
    # the estimate is turned to the right of vision: (x, y) of it are (-y, x)
    assert it.ekf["aid"]["ev_pos"]["observation_variance"][:2] == pytest.approx((0.4, 0.3))
    assert it.ekf["aid"]["ev_pos"]["observation"][:2] == pytest.approx((-1.0, 2.0))


def test_beside_gnss_steps_of_vision_are_fused():
    it = seen(8.0 + 1.0)
    asked(ev_control.control_external_vision_fusion, it, it.params)
    it.ekf["sensors"]["ev"]["sample"]["pos"] = 2.5, 1.1, -10.0
    asked(ev_control.control_external_vision_fusion, it, it.params)
    aid = it.ekf["aid"]["ev_pos"]
    assert aid["innovation"][:2] == pytest.approx((-0.5, -0.1))
    assert aid["observation_variance"][:2] == pytest.approx((0.3, 0.4))
    it.ekf["sensors"]["ev"]["sample"]["position_var"] = 0.01
    asked(ev_control.control_external_vision_fusion, it, it.params)
    assert aid["observation_variance"][:2] == pytest.approx((0.25, 0.25))


def test_velocity_and_yaw_of_vision_are_as_certain_as_they_say_but_for_a_floor():
    it = seen(256.0)
    it.ekf["sensors"]["ev"]["sample"]["velocity_var"] = 0.01, 0.04, 1e-6
    asked(ev_control.control_external_vision_fusion, it, it.params)
    assert it.ekf["state_reset"]["vel_ne_counter"] == 1
    assert it.ekf["aid"]["ev_vel"]["observation_variance"] == pytest.approx((0.01, 0.04, 0.0025))
    it = seen(16.0)
    asked(ev_control.control_external_vision_fusion, it, it.params)
    assert it.ekf["cs"]["ev_yaw"]
    assert it.ekf["state_reset"]["quat_counter"] == 1
    aid = it.ekf["aid"]["ev_yaw"]
    assert aid["observation"][0] == pytest.approx(-math.pi / 2)
    assert aid["observation_variance"][0] == pytest.approx(1e-4)
    set_time(it.ekf, START_US + 7_100_000)
    it.ekf["time_latest_us"] = START_US + 7_100_000
    it.ekf["sensors"]["ev"]["data_ready"] = False
    it.ekf["sensors"]["ev"]["newest_time_us"] = START_US
    asked(ev_control.control_external_vision_fusion, it, it.params)
    assert not it.ekf["cs"]["ev_yaw"]


@pytest.mark.parametrize(("release", "where_fused"), UNTIL_V113)
def test_airspeed_is_judged_where_it_is_fused(release, where_fused, monkeypatch):
    it, judged = flying(release, EKF2_ARSP_THR=8.0), []
    if where_fused:
        monkeypatch.setattr(airspeed_control, "fuse_airspeed", lambda *_: None)
        monkeypatch.setattr(airspeed_control, "_reset_wind", lambda *_: None)
    monkeypatch.setattr(airspeed_control, "update_airspeed", lambda *_: judged.append(True))
    it.ekf["cs"]["fixed_wing"] = True
    it.ekf["sensors"]["airspeed"]["sample"]["true_airspeed"] = 12.0
    it.ekf["aid"]["airspeed"]["innovation_rejected"] = True
    it.ekf["vel"] = 0.5, 0.0, 0.0
    asked(airspeed_control._take_airspeed_sample, it, it.params)
    assert it.ekf["cs"]["fuse_aspd"]
    assert bool(judged) != where_fused
    if where_fused:
        it.ekf["aid"]["airspeed"]["time_last_fuse"] = START_US
        asked(airspeed_control._take_airspeed_sample, it, it.params)
        assert not judged
        it.ekf["vel"] = 1.5, 0.0, 0.0
        asked(airspeed_control._take_airspeed_sample, it, it.params)
        assert judged


def test_sideslip_of_v1_13_is_asked_for_by_the_status_in_the_air_and_judged_at_speed(monkeypatch):
    it, judged = flying(V113, EKF2_FUSE_BETA=1.0), []
    monkeypatch.setattr(sideslip_fusion, "_update_sideslip", lambda *_: judged.append(True))
    monkeypatch.setattr(sideslip_fusion, "_fuse_sideslip", lambda *_: True)
    status = np.zeros(1, SYSTEM_FLAGS_SAMPLE)[0]
    status["status_is_new"], status["is_fixed_wing"] = True, True
    for in_air in (False, True):
        it.ekf["cs"]["in_air"] = in_air
        follow_system_flags_at_once(it.ekf, status)
        assert it.ekf["cs"]["fuse_beta"] == in_air
    it.ekf["vel"] = 4.0, 3.0, 4.8
    asked(sideslip_fusion.control_beta_fusion, it, it.params)
    assert it.ekf["cs"]["wind"]
    assert not judged
    set_time(it.ekf, START_US + 200_000)
    it.ekf["vel"] = 4.0, 3.0, 5.0
    asked(sideslip_fusion.control_beta_fusion, it, it.params)
    assert judged
    it.params["EKF2_FUSE_BETA"] = 0.0
    asked(sideslip_fusion.control_beta_fusion, it, it.params)
    assert not it.ekf["cs"]["fuse_beta"]


@pytest.mark.parametrize(("release", "last_only"), UNTIL_V113)
def test_drag_is_averaged_over_the_last_sample_of_an_interval_in_v1_13(release, last_only):
    drag = np.zeros(1, drag_accumulator(release))[0]
    assert bool(may_average.of(release).py_func(drag, False)) != last_only
    assert may_average.of(release).py_func(drag, True)


def test_drag_of_v1_13_is_as_steep_as_at_the_measured_force():
    # ½·1.2/50·v² + 0.1·v = 2 m/s² at 8.08 m/s, where it grows by 1.2/50·v + 0.1
    air = (math.sqrt(0.01 + 2.0 * 1.2 / 50.0 * 2.0) - 0.1) / (1.2 / 50.0)
    assert 0.5 * 1.2 / 50.0 * air**2 + 0.1 * air == pytest.approx(2.0)
    slope = drag_fusion._drag_slope.py_func
    assert slope(None, 1.2, 1.0 / 50.0, 0.1, -2.0) == pytest.approx(1.2 / 50.0 * air + 0.1)
    assert slope(None, 1.2, 0.0, 0.3, 2.0) == pytest.approx(0.3)
    assert slope(None, 1.2, 0.0, 0.05, 2.0) == pytest.approx(0.1)


def test_drag_of_v1_13_moves_the_wind_alone():
    it = flying(V113, EKF2_BCOEF_X=50.0, EKF2_BCOEF_Y=50.0, EKF2_MCOEF=0.0, EKF2_DRAG_NOISE=2.5)
    known = np.arange(24)
    it.ekf["P"][:] = np.diag(np.isin(known, (VELOCITY, VELOCITY + 1, WIND, WIND + 1)).astype(float))
    it.ekf["vel"] = 8.0, 0.0, 0.0
    it.ekf["air_density"] = 1.2
    it.ekf["sensors"]["drag"]["sample"]["accel_xy"] = -0.5 * 1.2 / 50.0 * 10.0**2, 0.0
    drag_fusion._fuse_by_slope.py_func(it.ekf, it.params)
    aid = it.ekf["aid"]["drag"]
    assert aid["innovation"][:2] == pytest.approx((0.5 * 1.2 / 50.0 * (100.0 - 64.0), 0.0))
    # the slope at the 10 m/s of the force, by the velocity and the wind, each with 1 m²/s²
    assert aid["innovation_variance"][0] == pytest.approx(2.0 * (1.2 / 50.0 * 10.0) ** 2 + 2.5)
    assert it.ekf["wind_vel"][0] < 0.0
    assert it.ekf["vel"].tolist() == [8.0, 0.0, 0.0]


def flow_at_once(**overrides: float) -> Flying:
    it = over_terrain(V113, EKF2_OF_QMIN=10.0, EKF2_OF_N_MIN=0.2, EKF2_OF_N_MAX=0.2, **overrides)
    it.params["EKF2_AID_MASK"] = 2.0
    it.ekf["flow"]["max_rate"] = 5.0
    it.ekf["flow_interval"] = 0.02
    flow_of(it, 0.5, -0.25)
    it.ekf["sensors"]["flow"]["sample"]["gyro_rate"] = 0.05, 0.0, 0.0
    integrated_flow.integrate_sample.py_func(it.ekf)
    it.ekf["flow_integrals"]["imu_time"] = 0.02
    it.ekf["flow_integrals"]["imu_angle"] = 0.0008, 0.0, 0.0
    it.ekf["terrain_filter"]["flow_is_good"] = True
    return it


def test_the_bias_of_the_gyro_of_flow_is_put_on_the_flow_in_v1_13():
    it = flow_at_once()
    integrated_flow_at_once._prepare_sample.py_func(it.ekf, it.params)
    # 0.05 rad/s of its gyro less 0.04 rad/s of the IMU, by a hundredth
    assert it.ekf["flow_integrals"]["gyro_bias"][0] == pytest.approx(0.0001)
    assert it.ekf["flow"]["rate_compensated"] == pytest.approx((0.5 - 0.05 + 0.0001, -0.25))
    it = flow_at_once()
    it.ekf["sensors"]["flow"]["sample"]["quality"] = 0
    integrated_flow_at_once._prepare_sample.py_func(it.ekf, it.params)
    assert it.ekf["flow"]["rate_compensated"] == pytest.approx((0.0001, 0.0))
    assert not it.ekf["terrain_filter"]["flow_is_good"]


def test_flow_of_v1_13_starts_with_its_velocity_once_there_is_a_heading(monkeypatch):
    it, fused = flow_at_once(), []
    monkeypatch.setattr(integrated_flow_at_once, "_fuse", lambda *_: fused.append(True))
    monkeypatch.setattr(integrated_flow_at_once, "is_flow_inhibited", lambda *_: False)
    monkeypatch.setattr(integrated_flow_at_once, "is_other_source_of_horizontal_aiding_than", lambda *_: False)
    it.ekf["range"]["cos_tilt"] = 1.0
    it.ekf["flow"]["rate_compensated"] = 0.4, -0.3
    it.ekf["cs"]["yaw_align"] = False
    integrated_flow_at_once._use_flow.py_func(it.ekf, it.params)
    assert not it.ekf["cs"]["opt_flow"]
    it.ekf["cs"]["yaw_align"] = True
    it.ekf["aid"]["terrain_range_finder"]["time_last_fuse"] = START_US
    integrated_flow_at_once._use_flow.py_func(it.ekf, it.params)
    # 10 m above the ground: (-10·-0.3, 10·0.4) m/s, to 10²·0.2² m²/s²
    assert it.ekf["vel"][:2] == pytest.approx((3.0, 4.0))
    assert it.ekf["P"][VELOCITY, VELOCITY] == pytest.approx(4.0)
    assert fused
    it.ekf["terrain"] = -9.8
    integrated_flow_at_once._reset_to_flow.py_func(it.ekf, it.params)
    assert it.ekf["vel"][:2].tolist() == [0.0, 0.0]


@pytest.mark.parametrize(("release", "wind_alone"), UNTIL_V114)
def test_drag_corrects_the_wind_alone_until_v1_15(release, wind_alone):
    it = flying(release)
    it.ekf["scratch"]["K"] = 1.0
    asked(drag_fusion._choose_gains, it)
    assert np.flatnonzero(it.ekf["scratch"]["K"]).tolist() == ([WIND, WIND + 1] if wind_alone else [*range(24)])


def test_the_first_drag_in_the_air_is_one_that_came_on_the_ground():
    it = flying(V114)
    it.ekf["cs"]["in_air"] = False
    it.ekf["sensors"]["drag"]["data_ready"], it.ekf["sensors"]["drag"]["sample"]["time_us"] = True, START_US
    assert asked(drag_fusion._is_sample_at_hand, it)
    it.ekf["sensors"]["drag"]["data_ready"] = False
    set_time(it.ekf, START_US + 90_000)
    it.ekf["cs"]["in_air"] = True
    assert asked(drag_fusion._is_sample_at_hand, it)
    assert not asked(drag_fusion._is_sample_at_hand, it)
    it.ekf["drag_waits"] = True
    set_time(it.ekf, START_US + 110_000)
    assert not asked(drag_fusion._is_sample_at_hand, it)


@pytest.mark.parametrize(("release", "averaged"), UNTIL_V114)
def test_a_clipped_sample_is_averaged_into_drag(release, averaged):
    drag = np.zeros(1, drag_accumulator(release))[0]
    imu = np.zeros(1, IMU_SAMPLE)[0]
    imu["delta_vel"], imu["delta_vel_dt"] = (0.1, 0.2, 0.0), 0.01
    for clipped in (0, 0, 1, 0, 0):
        imu["delta_vel_clipping"] = clipped
        made = accumulate_drag(drag, imu, 10, 10)
    assert bool(made) == averaged
    assert drag["sample_count"] == (0 if averaged else 2)


def test_yaw_of_vision_is_by_the_sequence_of_the_estimate_in_v1_13(monkeypatch):
    it = seen(16.0)
    monkeypatch.setattr(vision_by_mask, "fuse_yaw", lambda *_: True)
    sample = it.ekf["sensors"]["ev"]["sample"]
    sample["quat"] = np.array((1.0, 0.05, 0.1, 0.3)) / math.sqrt(1.0 + 0.05**2 + 0.1**2 + 0.3**2)
    R = np.zeros((3, 3))
    quat_to_dcm(sample["quat"], R)
    for roll, pitch, yaw in ((0.2, 0.0, (R[1, 0], R[0, 0])), (0.0, 0.2, (-R[0, 1], R[1, 1]))):
        it.ekf["q"] = math.cos(0.1), math.sin(roll / 2), math.sin(pitch / 2), 0.0
        quat_to_dcm(it.ekf["q"], it.ekf["R_to_earth"])
        vision_by_mask._control_yaw.py_func(it.ekf, it.params, False)
        assert it.ekf["aid"]["ev_yaw"]["innovation"][0] == pytest.approx(-math.atan2(*yaw))


@pytest.mark.parametrize(("mixed", "expected"), [(False, [0, 1, 2, 3, 4]), (True, [3, 0, 2, 1, 4])])
def test_flags_that_act_at_once_come_before_what_arrives_then(mixed, expected):
    actions = np.zeros(5, ACTION)
    # GNSS arrives at run 4 and is taken, the barometer arrives at run 6, flags at run 4, all before update 2
    actions["sensor"] = GNSS, GNSS, BARO, SYSTEM_FLAGS, GNSS
    actions["what"] = BUFFERED, DUE, BUFFERED, DUE, BUFFERED
    actions["run"] = 4, 1, 6, 4, 5
    actions["update"] = 2, 2, 2, 2, 3
    assert flight_schedule._order(actions, mixed).tolist() == expected


@pytest.mark.parametrize(("release", "asks"), UNTIL_V113)
def test_drag_of_v1_13_waits_for_a_yaw_that_the_field_is_to_reset(release, asks):
    it = flying(release)
    it.ekf["mag_modes"]["inhibited_for_long"] = True
    assert bool(asked(drag_fusion._is_heading_good, it)) != asks
