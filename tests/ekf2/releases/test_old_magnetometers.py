"""What releases before v1.16 do otherwise with the magnetometer, each in the situation that tells it from v1.16.

Expected: what docs/releases.md says of the behaviour, as a figure by hand; declinations of the older magnetic models as
PX4's own tables give them.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.ekf2.filter.aiding_estimator import START_US, set_time
from tests.ekf2.filter.height_and_field_records import put_sample, set_attitude
from tests.ekf2.releases.test_named_behaviours import Flying, flying

from fusetune.ekf2.feed.sensor_samples import GNSS_SAMPLE, IMU_SAMPLE
from fusetune.ekf2.filter import world_field, yaw_fusion
from fusetune.ekf2.filter.aid_sources import zero_innovation_heading_update
from fusetune.ekf2.filter.aid_sources.magnetometer import (
    field_checks,
    field_limits,
    mag_fusion,
    mag_heading,
    mag_inhibition_control,
    mag_mode_control,
    mag_modes,
    mag_resets,
    yaw_by_course,
)
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_control import control_mag_fusion
from fusetune.ekf2.filter.common.state import ATTITUDE, MAG_BODY, MAG_EARTH, TERRAIN
from fusetune.ekf2.filter.quaternion_core import quaternion_prediction
from fusetune.ekf2.numerics import world_magnetic_model_table as table
from fusetune.ekf2.numerics.world_magnetic_model import field_at

V113, V114, V115, V116 = "v1.13", "v1.14", "v1.15", "v1.16"
FIELD = np.array([0.22, 0.03, 0.40])
STRENGTH, DECLINATION, INCLINATION = 0.48, 0.06, 1.1


@pytest.mark.parametrize("release", table.OLDER_EPOCHS)
def test_older_grids_are_what_the_coefficients_give(release):
    shipped = table.read_tables(table.older_table_path(release))
    computed = table.compute_tables(table.OLDER_EPOCHS[release], table.OLDER_SCALES)
    for quantity in table.QUANTITIES:
        assert shipped[quantity].scale == pytest.approx(computed[quantity].scale, rel=1e-15)
        np.testing.assert_array_equal(shipped[quantity].values, computed[quantity].values)


@pytest.mark.parametrize(
    ("release", "zurich", "sao_paulo"),
    [("v1.13", 3.0582, -21.014), ("v1.14", 3.2287, -21.109), (V115, 3.3505, -21.173), (V116, 3.4056, -21.208)],
)
def test_each_release_has_the_model_of_its_date(release, zurich, sao_paulo):
    """Degrees that PX4's own tables of each release give."""
    ekf = flying(release).ekf
    declination, _, strength = world_field.field_of_model(ekf, 47.397742, 8.545594)
    assert math.degrees(declination) == pytest.approx(zurich, abs=6e-5)
    assert strength == pytest.approx(0.482, abs=0.001)
    declination, inclination, _ = world_field.field_of_model(ekf, -23.6, -46.6)
    assert math.degrees(declination) == pytest.approx(sao_paulo, abs=6e-4)
    assert math.degrees(inclination) == pytest.approx(-39.4, abs=0.5)
    assert field_at(-23.6, -46.6, release)[:2] == pytest.approx((declination, inclination), rel=1e-12)


def fix(latitude_deg: float, longitude_deg: float, accuracy: float = 900.0, fix_type: int = 2) -> np.void:
    sample = np.zeros(1, GNSS_SAMPLE)[0]
    sample["lat_deg"], sample["lon_deg"], sample["hacc"], sample["fix_type"] = (
        latitude_deg, longitude_deg, accuracy, fix_type,
    )  # fmt: skip
    return sample


def test_v1_15_looks_the_model_up_at_rough_fixes_and_keeps_it_within_a_degree():
    ekf = flying(V115).ekf
    look_up = world_field.look_field_up_by_fix
    assert not look_up(ekf, fix(47.4, 8.5, accuracy=1000.0), True)
    assert not look_up(ekf, fix(47.4, 8.5, fix_type=1), True)
    assert not look_up(ekf, fix(47.4, 8.5), False)
    assert not np.isfinite(ekf["mag"]["wmm_declination"])
    assert look_up(ekf, fix(47.4, 8.5), True)
    known = float(ekf["mag"]["wmm_declination"])
    assert ekf["field_history"]["wmm_time_last_set"] == START_US
    set_time(ekf, START_US + 900_000)
    assert not look_up(ekf, fix(47.4, 8.5), True)
    for seconds, place, kept in ((1.1, (47.4, 9.0), True), (2.2, (47.4, 14.0), False)):
        set_time(ekf, START_US + round(seconds * 1e6))
        assert look_up(ekf, fix(*place), True)
        assert (ekf["mag"]["wmm_declination"] == known) == kept


@pytest.mark.parametrize(("release", "assumed"), [("v1.13", True), ("v1.14", True), (V115, True), (V116, False)])
def test_the_parameter_was_the_declination_without_being_asked_for(release, assumed):
    it = flying(release, EKF2_DECL_TYPE=1.0, EKF2_MAG_DECL=10.0)
    declination = world_field.get_mag_declination(it.ekf, it.params)
    assert declination == pytest.approx(math.radians(10.0) if assumed else 0.0)


def test_yaw_stays_observable_until_the_acceleration_falls_below_the_limit():
    it = flying(V115, EKF2_MAG_ACCLIM=0.5)
    it.ekf["cs"]["gnss_pos"] = it.ekf["cs"]["gnss_vel"] = True
    for acceleration, observable in ((0.9, False), (1.1, True), (0.6, True), (0.4, False), (0.9, False)):
        it.ekf["accel_horiz_lpf"][:] = 0.6 * acceleration, 0.8 * acceleration
        mag_heading.update_yaw_observability(it.ekf, it.params)
        assert it.ekf["field_history"]["yaw_observable"] == observable
    it.ekf["accel_horiz_lpf"][0] = 5.0
    it.ekf["cs"]["gnss_pos"] = it.ekf["cs"]["gnss_vel"] = False
    mag_heading.update_yaw_observability(it.ekf, it.params)
    assert not it.ekf["field_history"]["yaw_observable"]


def with_model(it: Flying) -> np.ndarray:
    """Let the model's field be known; return it (NED, Gauss)."""
    mag = it.ekf["mag"]
    mag["wmm_declination"], mag["wmm_inclination"], mag["wmm_strength"] = DECLINATION, INCLINATION, STRENGTH
    world_field.earth_field_vector.py_func(DECLINATION, INCLINATION, STRENGTH, mag["wmm_earth_field"])
    return np.array(mag["wmm_earth_field"])


@pytest.mark.parametrize(
    ("turned_by", "scaled_by", "turned_to", "scaled_to"),
    [
        (0.4, 1.0, 0.4, 1.0),
        (0.7, 1.0, 0.5, 1.0),
        (-0.7, 1.2, -0.5, 1.2),
        (0.2, 0.3, 0.2, 0.5),
        (2.0, 0.3, 0.5, 0.5),
        (3.0, 1e-9, 0.0, 1.0),
    ],
)
def test_declination_and_horizontal_field_are_limited(turned_by, scaled_by, turned_to, scaled_to):
    """Within 0.5 rad of the model and above half of its strength; what has collapsed becomes the model's."""
    for release in (V115, V116):
        it = flying(release, EKF2_DECL_TYPE=3.0)
        north, east, down = with_model(it)
        horizontal = math.hypot(north, east)
        it.ekf["mag_I"][:] = (
            scaled_by * horizontal * math.cos(DECLINATION + turned_by),
            scaled_by * horizontal * math.sin(DECLINATION + turned_by),
            down,
        )
        before = np.array(it.ekf["mag_I"])
        field_limits.limit_field(it.ekf, it.params)
        if release == V116:
            np.testing.assert_array_equal(it.ekf["mag_I"], before)
            continue
        assert math.hypot(*it.ekf["mag_I"][:2]) == pytest.approx(scaled_to * horizontal)
        assert math.atan2(it.ekf["mag_I"][1], it.ekf["mag_I"][0]) == pytest.approx(DECLINATION + turned_to)


def test_a_field_without_reference_is_not_limited():
    it = flying(V115, EKF2_DECL_TYPE=1.0, EKF2_MAG_DECL=10.0)
    it.ekf["mag_I"][:] = -0.3, 0.1, 0.4
    field_limits.limit_field(it.ekf, it.params)
    np.testing.assert_array_equal(it.ekf["mag_I"], [-0.3, 0.1, 0.4])
    it.params["EKF2_DECL_TYPE"] = 2.0
    field_limits.limit_field(it.ekf, it.params)
    assert math.atan2(it.ekf["mag_I"][1], it.ekf["mag_I"][0]) == pytest.approx(math.radians(10.0) + 0.5)


def with_yaw_estimate(it: Flying, yaw: float) -> None:
    it.ekf["gsf"]["vel_fuse_started"] = True
    it.ekf["gsf"]["yaw"], it.ekf["gsf"]["yaw_variance"] = yaw, 0.01


@pytest.mark.parametrize("reset_heading", [False, True])
def test_v1_15_resets_the_body_field_as_the_yaw_estimator_wants(reset_heading, monkeypatch):
    it = flying(V115)
    expected_field = with_model(it)
    set_attitude(it.ekf, 0.2, 0.1, 2.5)
    body_if_turned = it.ekf["R_to_earth"].T @ expected_field
    set_attitude(it.ekf, 0.2, 0.1, 1.0)
    it.ekf["cs"]["yaw_align"] = True
    it.ekf["P"][MAG_EARTH : MAG_BODY + 3, :] = it.ekf["P"][:, MAG_EARTH : MAG_BODY + 3] = 0.3
    with_yaw_estimate(it, 2.5)
    monkeypatch.setattr(mag_resets, "reset_mag_heading", lambda ekf, params, mag: None)
    mag_resets.reset_mag_states.of(V115).py_func(it.ekf, it.params, FIELD, reset_heading)
    np.testing.assert_allclose(it.ekf["mag_I"], expected_field)
    np.testing.assert_allclose(it.ekf["mag_B"], FIELD - body_if_turned, atol=1e-12)
    block = it.ekf["P"][MAG_EARTH : MAG_BODY + 3, MAG_EARTH : MAG_BODY + 3]
    np.testing.assert_allclose(block, np.eye(6) * it.params["EKF2_MAG_NOISE"] ** 2)
    assert it.ekf["field_history"]["declination_fused"]
    assert it.ekf["cs"]["mag_aligned_in_flight"]


def test_v1_15_without_yaw_estimate_takes_the_present_yaw_or_none():
    it = flying(V115)
    field = with_model(it)
    set_attitude(it.ekf, 0.2, 0.1, 1.0)
    it.ekf["cs"]["yaw_align"] = True
    mag_resets.reset_mag_states(it.ekf, it.params, FIELD, False)
    np.testing.assert_allclose(it.ekf["mag_B"], FIELD - it.ekf["R_to_earth"].T @ field, atol=1e-12)
    mag_resets.reset_mag_states(it.ekf, it.params, FIELD, True)
    np.testing.assert_array_equal(it.ekf["mag_B"], 0.0)


def feed(it: Flying, field: np.ndarray = FIELD, samples: int = 1, reset: bool = False) -> None:
    """Advance by 20 ms and one sample, `samples` times."""
    for _ in range(samples):
        set_time(it.ekf, int(it.ekf["time_delayed_us"]) + 20_000)
        it.ekf["cs_prev"] = it.ekf["cs"].copy()
        it.ekf["state_reset_prev"]["quat_counter"] = it.ekf["state_reset"]["quat_counter"]
        put_sample(it.ekf, "mag", 5_000, mag=field, reset=reset)
        control_mag_fusion(it.ekf, it.params)


def on_ground(**overrides: float) -> Flying:
    it = flying(V115, EKF2_MAG_CHECK=0.0, **overrides)
    it.ekf["cs"]["in_air"] = False
    it.ekf["cs_prev"]["in_air"] = False
    return it


def test_v1_15_starts_with_the_sixth_sample_and_tells_it_from_the_next_on():
    it = on_ground()
    aid = it.ekf["aid"]["mag"]
    told = []
    for _ in range(8):
        feed(it)
        told.append((bool(it.ekf["cs"]["mag"]), bool(aid["timestamp_sample"]), bool(aid["fused"])))
    assert told == [(False, False, False)] * 5 + [(True, False, False)] + [(True, True, True)] * 2
    assert it.ekf["cs"]["yaw_align"]
    assert it.ekf["cs"]["mag_dec"]
    np.testing.assert_allclose(aid["observation"], FIELD - it.ekf["mag_B"], atol=1e-9)


def test_v1_15_fuses_the_declination_first_once_the_covariance_is_new():
    """0.02 rad against 0.05 Gauss of 0.22 Gauss horizontally, which is 0.22 rad: it leaves 0.02 rad."""
    it = on_ground(EKF2_DECL_TYPE=2.0, EKF2_MAG_DECL=8.0)
    feed(it, samples=6)
    assert not it.ekf["field_history"]["declination_fused"]
    feed(it, 10.0 * FIELD)
    assert it.ekf["aid"]["mag"]["innovation_rejected"]
    assert it.ekf["field_history"]["declination_fused"]
    field, P = it.ekf["mag_I"], it.ekf["P"][MAG_EARTH : MAG_EARTH + 2, MAG_EARTH : MAG_EARTH + 2]
    gradient = np.array([-field[1], field[0]]) / (field[0] ** 2 + field[1] ** 2)
    assert math.sqrt(gradient @ P @ gradient) == pytest.approx(0.02, rel=0.01)


def test_v1_15_starts_anew_after_another_reset_of_the_yaw():
    it = on_ground(EKF2_DECL_TYPE=2.0, EKF2_MAG_DECL=8.0)
    feed(it, samples=8)
    assert it.ekf["cs"]["mag"]
    set_time(it.ekf, int(it.ekf["time_delayed_us"]) + 10_000)
    it.ekf["sensors"]["mag"]["data_ready"] = False
    it.ekf["state_reset"]["quat_counter"] += 1
    control_mag_fusion(it.ekf, it.params)
    assert not it.ekf["cs"]["mag"]
    assert not it.ekf["cs"]["mag_hdg"]
    assert it.ekf["cs"]["yaw_align"]
    assert not it.ekf["field_history"]["declination_fused"]


def test_v1_15_resets_twice_in_flight_then_stops_and_keeps_the_yaw_aligned():
    it = on_ground()
    feed(it, samples=8)
    it.ekf["cs"]["in_air"] = True
    it.ekf["cs"]["mag_aligned_in_flight"] = True
    counts, running = [], []
    for _ in range(3):
        it.ekf["aid"]["mag"]["time_last_fuse"] = int(it.ekf["time_delayed_us"]) - 7_100_000
        it.ekf["cs_prev"]["in_air"] = True
        feed(it, 10.0 * FIELD)
        counts.append(int(it.ekf["field_history"]["resets_available"]))
        running.append(bool(it.ekf["cs"]["mag"]))
    assert counts == [1, 0, 0]
    assert running == [True, True, False]
    assert it.ekf["cs"]["yaw_align"]


@pytest.mark.parametrize(
    ("disturbed", "consistent", "mode"), [(False, True, "3d"), (True, True, "3d"), (False, False, "")]
)
def test_v1_15_fuses_a_disturbed_field_once_it_is_aligned_in_flight(disturbed, consistent, mode):
    it = on_ground()
    feed(it, samples=8)
    it.ekf["cs"]["in_air"] = it.ekf["cs_prev"]["in_air"] = True
    it.ekf["cs"]["mag_aligned_in_flight"] = True
    it.ekf["cs"]["gnss_pos"] = it.ekf["cs"]["gnss_vel"] = True
    it.ekf["cs"]["mag_heading_consistent"] = consistent
    if not consistent:
        it.ekf["mag"]["heading_innovation_lpf"] = 1.0
    if disturbed:
        it.params["EKF2_MAG_CHECK"] = 1.0
        it.ekf["mag"]["wmm_strength"] = 5.0
    feed(it)
    assert it.ekf["cs"]["mag_field_disturbed"] == disturbed
    assert bool(it.ekf["cs"]["mag_3d"]) == (mode == "3d")
    assert not it.ekf["cs"]["mag_hdg"]
    assert not it.ekf["cs"]["mag_dec"]


@pytest.mark.parametrize("release", [V113, V114])
def test_older_field_jacobian_is_by_the_quaternion(release):
    """Central differences of Rᵀm, R the matrix of a quaternion of any length; the last element stands at the end."""
    it = flying(release)
    set_attitude(it.ekf, 0.4, -0.3, 2.0)
    it.ekf["mag_I"][:] = 0.2, -0.1, 0.4
    q = np.array(it.ekf["q"])

    def body_field(q: np.ndarray) -> np.ndarray:
        w, u = q[0], q[1:]
        field = np.array(it.ekf["mag_I"])
        return (w * w - u @ u) * field + 2.0 * u * (u @ field) - 2.0 * w * np.cross(u, field)

    np.testing.assert_allclose(body_field(q), it.ekf["R_to_earth"].T @ it.ekf["mag_I"], atol=1e-12)
    H = np.zeros(24)
    for axis in range(3):
        mag_fusion.compute_mag_h(it.ekf, axis, H)
        for element, place in enumerate((ATTITUDE, ATTITUDE + 1, ATTITUDE + 2, TERRAIN)):
            step = np.zeros(4)
            step[element] = 1e-6
            derivative = (body_field(q + step) - body_field(q - step))[axis] / 2e-6
            assert H[place] == pytest.approx(derivative, abs=1e-8)
        np.testing.assert_allclose(H[MAG_EARTH : MAG_EARTH + 3], it.ekf["R_to_earth"][:, axis])
        np.testing.assert_array_equal(H[MAG_BODY : MAG_BODY + 3], np.eye(3)[axis])


def follow_turn(it: Flying, turn: float, dt: float) -> None:
    """Predict a turn about down (rad) in an interval (s), level."""
    it.ekf["scratch"]["quat_before"][:3] = 0.0, 0.0, turn
    it.ekf["imu_delayed"]["delta_ang_dt"] = dt
    quaternion_prediction.follow_turn(it.ekf)


def test_the_field_is_fused_while_acceleration_or_turn_tells_it_and_its_covariance_is_kept():
    it = flying(V114, EKF2_MAG_TYPE=0.0, EKF2_MAG_ACCLIM=0.5)
    it.params["EKF2_MAG_YAWLIM"] = 0.2
    modes, P = it.ekf["mag_modes"], it.ekf["P"]
    it.ekf["cs"]["mag_aligned_in_flight"] = True
    mag_modes.select_mode(it.ekf, it.params)
    assert it.ekf["cs"]["mag_hdg"]
    # turning at 0.25 rad/s for a second, then at 0.12: 0.95^n of the filter is left after n steps
    for _ in range(100):
        follow_turn(it, 0.0025, 0.01)
    assert modes["turn_rate_lpf"] == pytest.approx(0.25 * (1.0 - 0.95**100))
    modes["saved_body_variance"][:] = 1e-4, 2e-4, 3e-4
    modes["saved_down_variance"] = 4e-4
    modes["saved_horizontal_covariance"][:] = [[5e-4, 1e-5], [1e-5, 6e-4]]
    mag_modes.select_mode(it.ekf, it.params)
    assert it.ekf["cs"]["mag_3d"]
    assert not it.ekf["cs"]["mag_hdg"]
    expected = np.diag([5e-4, 6e-4, 4e-4, 1e-4, 2e-4, 3e-4])
    expected[0, 1] = expected[1, 0] = 1e-5
    np.testing.assert_array_equal(P[MAG_EARTH : MAG_BODY + 3, MAG_EARTH : MAG_BODY + 3], expected)
    assert not P[:MAG_EARTH, MAG_EARTH : MAG_BODY + 3].any()
    for rate, fused in ((0.12, True), (0.08, True), (0.08, False)):
        set_time(it.ekf, int(it.ekf["time_delayed_us"]) + 1_900_000)
        follow_turn(it, rate * 1.9, 1.9)
        modes["turn_rate_lpf"] = rate
        mag_modes.select_mode(it.ekf, it.params)
        assert bool(it.ekf["cs"]["mag_3d"]) == fused


def test_the_turn_of_v1_13_is_that_of_the_newest_samples_but_the_last():
    it = flying("v1.13")
    modes, output = it.ekf["mag_modes"], it.ekf["output"]
    output["gyro_bias"], output["delta_angle_corr"], output["R_to_earth"] = (0.0, 0.0, 0.1), 0.0, np.eye(3)
    imu = np.zeros(1, IMU_SAMPLE)[0]
    imu["delta_ang"], imu["delta_ang_dt"] = (0.0, 0.0, 0.0015), 0.005
    for turned in (0.0, 0.001, 0.002):
        quaternion_prediction._follow_newest_turn(it.ekf, imu)
        assert modes["turn"] == pytest.approx(turned)  # 0.3 rad/s, less a bias of 0.1, for 5 ms each
    assert modes["turn_rate_lpf"] == pytest.approx(0.2 * (1.0 - 0.95**2))


@pytest.mark.parametrize(("wanted", "gnss", "fused"), [(0, False, True), (0, True, False), (4, True, True)])
def test_the_declination_is_fused_with_the_field_where_gnss_does_not_tell_north(wanted, gnss, fused):
    it = flying(V114, EKF2_DECL_TYPE=float(wanted))
    it.ekf["cs"]["gnss_pos"] = it.ekf["cs"]["gnss_vel"] = gnss
    it.ekf["cs"]["mag_3d"] = True
    mag_modes.update_declination_mode(it.ekf, it.params)
    assert it.ekf["cs"]["mag_dec"] == fused
    it.ekf["cs"]["mag_3d"] = False
    mag_modes.update_declination_mode(it.ekf, it.params)
    assert not it.ekf["cs"]["mag_dec"]


@pytest.mark.parametrize(
    ("strength", "known", "disturbed"),
    [(0.69, True, True), (0.67, True, False), (0.69, False, False), (0.86, False, True)],
)
def test_the_strength_is_checked_within_a_fifth_of_a_gauss_of_the_model(strength, known, disturbed):
    """0.48 ± 0.2 Gauss, or 0.45 ± 0.4 Gauss."""
    it = flying(V114, EKF2_MAG_CHECK=1.0)
    if known:
        with_model(it)
    field = np.array([0.0, 0.6, 0.8]) * strength
    assert field_checks.is_strength_disturbed(it.ekf, it.params, field) == disturbed
    it.params["EKF2_MAG_CHECK"] = 0.0
    assert not field_checks.is_strength_disturbed(it.ekf, it.params, field)
    it.params["EKF2_MAG_CHECK"], it.params["EKF2_MAG_TYPE"] = 1.0, 4.0
    assert not field_checks.is_strength_disturbed(it.ekf, it.params, field)


def test_every_rough_fix_is_looked_up_until_v1_14_and_the_first_asks_for_the_yaw():
    ekf = flying(V114).ekf
    assert not world_field.look_field_up_by_fix(ekf, fix(47.4, 8.5), False)
    assert world_field.look_field_up_by_fix(ekf, fix(47.4, 8.5), True)
    assert ekf["mag_modes"]["yaw_reset_requested"]
    first, ekf["mag_modes"]["yaw_reset_requested"] = float(ekf["mag"]["wmm_declination"]), False
    assert world_field.look_field_up_by_fix(ekf, fix(47.4, 8.6), True)
    assert ekf["mag"]["wmm_declination"] != first
    assert not ekf["mag_modes"]["yaw_reset_requested"]


def test_v1_14_follows_the_field_while_it_levels():
    it = flying(V114, EKF2_DECL_TYPE=0.0, EKF2_MAG_DECL=5.0)
    it.ekf["cs"]["tilt_align"] = it.ekf["cs"]["in_air"] = it.ekf["cs_prev"]["in_air"] = False
    set_attitude(it.ekf, 0.2, 0.1, 1.0)
    body = it.ekf["R_to_earth"].T @ np.array([0.25, 0.0, 0.4])
    set_attitude(it.ekf, 0.2, 0.1, 0.0)
    it.ekf["mag"]["counter"] = 1
    it.ekf["mag"]["lpf"] = body
    put_sample(it.ekf, "mag", 5_000, mag=body)
    control_mag_fusion.of(V114).py_func(it.ekf, it.params)
    R = it.ekf["R_to_earth"]
    assert math.atan2(R[1, 0], R[0, 0]) == pytest.approx(1.0 + math.radians(5.0), abs=1e-9)
    assert math.atan2(it.ekf["mag_I"][1], it.ekf["mag_I"][0]) == pytest.approx(math.radians(5.0), abs=1e-9)
    assert not it.ekf["cs"]["yaw_align"]
    heading = it.ekf["aid"]["mag_heading"]
    assert heading["timestamp_sample"] == START_US - 5_000
    assert heading["observation"][0] == pytest.approx(1.0 + math.radians(5.0))
    assert heading["innovation"][0] == pytest.approx(-1.0 - math.radians(5.0))
    assert not heading["fused"]


@pytest.mark.parametrize("release", [V115, V116])
def test_a_body_field_is_known_to_its_noise_right_after_a_reset_of_v1_15(release):
    """0.05² Gauss² and 1e-12 Gauss² of process noise: in single precision, as PX4 has it, that is the limit itself."""
    it = flying(release, EKF2_MAG_NOISE=0.05)
    it.ekf["P"][MAG_BODY : MAG_BODY + 3, MAG_BODY : MAG_BODY + 3] = np.eye(3) * (
        it.params["EKF2_MAG_NOISE"] ** 2 + 1e-12
    )
    assert bool(mag_heading.is_mag_bias_good(it.ekf, it.params)) == (release == V115)
    it.ekf["P"][MAG_BODY, MAG_BODY] += 1e-9
    assert not mag_heading.is_mag_bias_good(it.ekf, it.params)


def resting(release: str, **overrides: float) -> Flying:
    """On the ground, levelled and aligned to north, without GNSS."""
    it = flying(release, EKF2_HEAD_NOISE=0.3, **overrides)
    for flags in (it.ekf["cs"], it.ekf["cs_prev"]):
        flags["in_air"], flags["vehicle_at_rest"], flags["yaw_align"] = False, True, True
    return it


def fused_yaws(it: Flying, module: object, monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, float]]:
    """Innovation and variance of each heading that will be fused."""
    fused: list[tuple[float, float]] = []

    def fuse(ekf, params, aid, H):
        fused.append((float(aid["innovation"][0]), float(aid["observation_variance"][0])))
        ekf["time_last_heading_fuse"] = ekf["time_delayed_us"]
        return True

    monkeypatch.setattr(module, "fuse_yaw", fuse)
    return fused


def test_v1_14_holds_the_yaw_at_which_the_vehicle_came_to_rest(monkeypatch):
    it = resting(V114)
    module = zero_innovation_heading_update
    fused = fused_yaws(it, module, monkeypatch)
    monkeypatch.setattr(module, "_fuse_yaw_difference", module._fuse_yaw_difference.py_func)
    hold = module.control_zero_innovation_heading_update.of(V114).py_func
    for seconds, yaw in ((0.0, 0.5), (0.21, 0.52), (0.3, 0.53), (0.42, 0.54)):
        set_time(it.ekf, START_US + round(seconds * 1e6))
        set_attitude(it.ekf, 0.0, 0.0, yaw)
        hold(it.ekf, it.params)
    # at rest every 0.2 s, against the first yaw
    assert fused == [(pytest.approx(0.02), 0.01), (pytest.approx(0.04), 0.01)]

    # in motion a zero where the yaw is uncertain by more than 0.3 rad, and then the yaw is forgotten
    it.ekf["cs"]["vehicle_at_rest"] = False
    set_time(it.ekf, START_US + 700_000)
    hold(it.ekf, it.params)
    assert len(fused) == 2
    it.ekf["P"][[0, 1, 2, 23], [0, 1, 2, 23]] = 0.1
    hold(it.ekf, it.params)
    assert fused[2] == (0.0, 0.25)
    assert math.isnan(it.ekf["mag_modes"]["static_yaw"])

    # while levelling always, tighter at rest
    it.ekf["cs"]["tilt_align"] = False
    hold(it.ekf, it.params)
    it.ekf["cs"]["vehicle_at_rest"] = True
    hold(it.ekf, it.params)
    assert fused[3:] == [(0.0, 0.1), (0.0, 0.001)]
    assert it.ekf["time_last_heading_fuse"] == 0


def test_v1_13_holds_a_yaw_in_every_update_without_a_magnetometer(monkeypatch):
    it = resting(V113, EKF2_MAG_TYPE=5.0)
    fused = fused_yaws(it, mag_inhibition_control, monkeypatch)
    for name in ("_fuse_held_yaw", "_fuse_or_hold_yaw"):
        monkeypatch.setattr(mag_inhibition_control, name, getattr(mag_inhibition_control, name).py_func)
    control = control_mag_fusion.of(V113).py_func
    it.ekf["sensors"]["mag"]["data_ready"] = False
    for yaw in (0.5, 0.52, 0.53):
        set_attitude(it.ekf, 0.0, 0.0, yaw)
        control(it.ekf, it.params)
    assert fused == [(0.0, 0.01), (pytest.approx(0.02), 0.01), (pytest.approx(0.03), 0.01)]
    # in motion the present one, looser once the quaternion is uncertain
    it.ekf["cs"]["vehicle_at_rest"] = False
    it.ekf["P"][[0, 1, 2, 23], [0, 1, 2, 23]] = 1e-5
    control(it.ekf, it.params)
    it.ekf["P"][0, 0] = 1e-3
    control(it.ekf, it.params)
    assert fused[3:] == [(0.0, 0.01), (0.0, 0.25)]
    # another yaw makes that needless
    it.ekf["cs"]["ev_yaw"] = True
    control(it.ekf, it.params)
    assert len(fused) == 5


@pytest.mark.parametrize(
    ("speed", "error", "rejected", "aligned", "to_course"),
    [
        (10.0, 0.6, True, True, True),
        (10.0, 0.4, True, True, False),
        (10.0, 0.6, False, True, False),
        (10.0, 0.0, False, False, True),
        (4.0, 0.6, True, True, False),
    ],
)
def test_v1_13_turns_a_fixed_wing_to_its_course(speed, error, rejected, aligned, to_course, monkeypatch):
    """Where courses differ by over 0.5 rad and the velocity is rejected, or the yaw was never aligned, by 5 m/s."""
    it = flying(V113)
    cs = it.ekf["cs"]
    cs["gnss_pos"] = cs["gnss_vel"] = cs["fixed_wing"] = True
    cs["yaw_align"] = aligned
    set_attitude(it.ekf, 0.0, 0.0, 0.3)
    it.ekf["vel"][:] = 10.0 * math.cos(0.2), 10.0 * math.sin(0.2), 0.0
    it.ekf["sensors"]["gnss"]["sample"]["vel"][:2] = speed * math.cos(0.2 + error), speed * math.sin(0.2 + error)
    it.ekf["sensors"]["gnss"]["sample"]["sacc"] = 0.5
    it.ekf["aid"]["gnss_vel"]["test_ratio"][0] = 1.5 if rejected else 0.5
    resets = []
    for name in ("reset_velocity_to_gnss", "reset_horizontal_position_to_gnss", "reset_yaw_to_field"):
        monkeypatch.setattr(yaw_by_course, name, lambda *_, name=name: resets.append(name) or True)
    monkeypatch.setattr(yaw_by_course, "_reset_yaw_to_course", yaw_by_course._reset_yaw_to_course.py_func)
    assert yaw_by_course.realign_yaw_by_course.py_func(it.ekf, it.params)
    R = it.ekf["R_to_earth"]
    yaw = math.atan2(R[1, 0], R[0, 0])
    assert yaw == pytest.approx(0.3 + error if to_course else 0.3)
    moved = to_course and rejected
    assert resets == (
        ["reset_yaw_to_field"]
        if speed < 5.0
        else ["reset_velocity_to_gnss", "reset_horizontal_position_to_gnss"]
        if moved
        else []
    )
    assert it.ekf["mag_modes"]["bad_yaw_events"] == int(moved)


@pytest.mark.parametrize(("release", "forced"), [(V113, True), (V114, False)])
def test_a_heading_rejected_on_the_ground_is_forced_every_time_in_v1_13(release, forced):
    it = resting(release)
    it.ekf["time_last_in_air"] = START_US - 6_000_000
    aid = it.ekf["aid"]["mag_heading"]
    aid["time_last_fuse"] = START_US - 500_000
    assert bool(yaw_fusion._may_force_yaw.py_func(it.ekf, aid)) == forced


@pytest.mark.parametrize(("release", "told"), [(V113, 0.22), (V114, 0.12), (V115, 0.12)])
def test_the_body_field_is_taken_off_what_is_told_in_v1_14_and_v1_15(release, told):
    it = flying(release)
    it.ekf["mag_B"][:] = 0.1, 0.0, 0.0
    mag_fusion.judge_mag(it.ekf, it.params, FIELD, 0.0025)
    assert it.ekf["aid"]["mag"]["observation"][0] == pytest.approx(told)
    assert it.ekf["aid"]["mag"]["innovation"][0] == pytest.approx(0.1 - FIELD[0])


def test_a_noise_of_0_02_gauss_does_not_make_the_body_field_known():
    it = flying(V114, EKF2_MAG_NOISE=0.02)
    it.ekf["cs"]["mag_aligned_in_flight"] = True
    block = it.ekf["P"][MAG_BODY : MAG_BODY + 3, MAG_BODY : MAG_BODY + 3]
    for variance, known in ((it.params["EKF2_MAG_NOISE"] ** 2, False), (0.0199**2, True), (0.0, False)):
        block[...] = np.eye(3) * variance
        assert bool(mag_mode_control._is_body_field_known(it.ekf)) == known


@pytest.mark.parametrize(("release", "at_first"), [(V113, True), (V114, False), (V116, False)])
def test_v1_13_finds_all_axes_of_the_field_before_one_is_fused(release, at_first, monkeypatch):
    """After the first axis the field is said to be larger by 0.1 Gauss."""
    it = flying(release)
    aid, innovations = it.ekf["aid"]["mag"], []
    aid["innovation"][:], aid["innovation_variance"][:], aid["observation_variance"][:] = FIELD, 1.0, 0.0025

    def update(ekf, params, R, innovation):
        innovations.append(float(innovation))
        ekf["mag_B"][:] = 0.1
        return True

    monkeypatch.setattr(mag_fusion, "measurement_update", update)
    monkeypatch.setattr(mag_fusion, "scale_kalman_gain", lambda *_: None)
    mag_fusion.fuse_mag.py_func(it.ekf, it.params, np.zeros(3), 0.0025, True, True)
    assert innovations == pytest.approx(FIELD if at_first else [FIELD[0], 0.1, 0.1])


@pytest.mark.parametrize(("release", "kept"), [(V113, False), (V114, True), (V116, True)])
def test_a_heading_of_v1_13_leaves_the_field_alone(release, kept):
    ekf = flying(release).ekf
    ekf["scratch"]["K"][:] = 1.0
    yaw_fusion._keep_gains_of_yaw(ekf)
    expected = np.ones(24)
    expected[MAG_EARTH : MAG_BODY + 3] = kept
    np.testing.assert_array_equal(ekf["scratch"]["K"], expected)
