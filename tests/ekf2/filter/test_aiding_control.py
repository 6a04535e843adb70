"""When gravity, optical flow, airspeed, sideslip and drag start, continue and stop.

Expected values are those of the conditions that PX4 v1.16 documents for its parameters, and of hand calculations with
the simple states that each test sets up.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.ekf2.filter.aiding_estimator import CONSTANTS_ONE_G, START_US, hovering, parameters, set_time

from fusetune.ekf2.feed.inputs import IMU_ROW
from fusetune.ekf2.filter.aid_sources.airspeed.airspeed_control import control_air_data_fusion
from fusetune.ekf2.filter.aid_sources.drag.drag_accumulator import accumulate_drag
from fusetune.ekf2.filter.aid_sources.drag.drag_fusion import control_drag_fusion
from fusetune.ekf2.filter.aid_sources.drag.drag_memory import DRAG_ACCUMULATOR
from fusetune.ekf2.filter.aid_sources.gravity.gravity_fusion import control_gravity_fusion
from fusetune.ekf2.filter.aid_sources.optical_flow.optical_flow_control import control_optical_flow_fusion
from fusetune.ekf2.filter.aid_sources.sideslip.sideslip_fusion import control_beta_fusion
from fusetune.ekf2.filter.common.state import TERRAIN, VELOCITY, WIND
from fusetune.ekf2.filter.wind import reset_wind_to_external_observation


def test_gravity_is_fused_only_without_horizontal_aiding() -> None:
    params = parameters()
    memory = hovering(params)
    ekf = memory[0]
    control_gravity_fusion(ekf, params[0])
    assert ekf["cs"]["gravity_vector"]
    assert ekf["P"][0, 0] < 0.01

    ekf["cs"]["gnss_vel"] = True
    before = ekf["P"].copy()
    control_gravity_fusion(ekf, params[0])
    assert not ekf["cs"]["gravity_vector"]
    assert ekf["aid"]["gravity"]["fused"], "the status counts as fused at every update"
    np.testing.assert_array_equal(ekf["P"], before)


@pytest.mark.parametrize(("factor", "used"), [(0.89, False), (0.91, True), (1.09, True), (1.11, False)])
def test_gravity_needs_about_one_g_in_motion(factor: float, used: bool) -> None:
    params = parameters()
    memory = hovering(params)
    memory[0]["accel_magnitude_filt"] = factor * CONSTANTS_ONE_G
    control_gravity_fusion(memory[0], params[0])
    assert memory[0]["cs"]["gravity_vector"] == used
    memory[0]["cs"]["vehicle_at_rest"] = True
    control_gravity_fusion(memory[0], params[0])
    assert memory[0]["cs"]["gravity_vector"]


def test_gravity_corrects_tilt_towards_the_measured_vertical() -> None:
    """Rolled by 2°, a level filter must move its roll by K·innovation = P/(P + R)·sin 2° about north."""
    params = parameters()
    memory = hovering(params)
    ekf = memory[0]
    roll = math.radians(2.0)
    force = CONSTANTS_ONE_G * 0.01
    ekf["imu_delayed"]["delta_vel"] = [0.0, -force * math.sin(roll), -force * math.cos(roll)]
    control_gravity_fusion(ekf, params[0])
    expected = 0.01 / (0.01 + 1.0) * math.sin(roll)
    assert 2.0 * math.asin(ekf["q"][1]) == pytest.approx(expected, rel=1e-4)
    assert ekf["aid"]["gravity"]["innovation"][1] == pytest.approx(math.sin(roll), rel=1e-9)


def test_gravity_beyond_a_quarter_sigma_is_rejected() -> None:
    """The gate of 0.25 σ with σ ≈ 1 lets 14° pass and stops 15°."""
    for degrees, rejected in ((14.0, False), (15.0, True)):
        params = parameters()
        memory = hovering(params)
        ekf = memory[0]
        angle = math.radians(degrees)
        ekf["imu_delayed"]["delta_vel"] = [-0.098 * math.sin(angle), 0.0, -0.098 * math.cos(angle)]
        control_gravity_fusion(ekf, params[0])
        assert ekf["aid"]["gravity"]["innovation_rejected"] == rejected


def _offer_flow(ekf: np.void, rate: tuple[float, float], time_us: int, quality: int = 255) -> None:
    set_time(ekf, time_us)
    ekf["sensors"]["flow"]["exists"] = True
    ekf["sensors"]["flow"]["data_ready"] = True
    ekf["sensors"]["flow"]["sample"]["time_us"] = time_us
    ekf["sensors"]["flow"]["sample"]["flow_rate"] = rate
    ekf["sensors"]["flow"]["sample"]["gyro_rate"] = 0.0
    ekf["sensors"]["flow"]["sample"]["quality"] = quality


def test_flow_starts_after_ten_samples_and_resets_velocity_to_them() -> None:
    """Flying north at 2 m/s, 10 m up, the ground passes at 0.2 rad/s about the negative Y axis."""
    params = parameters(EKF2_OF_CTRL=1)
    memory = hovering(params)
    ekf = memory[0]
    for i in range(11):
        assert not ekf["cs"]["opt_flow"]
        _offer_flow(ekf, (0.0, -0.2), START_US + 40_000 * i)
        control_optical_flow_fusion(ekf, params[0])
    assert ekf["cs"]["opt_flow"]
    assert ekf["cs"]["opt_flow_terrain"]
    assert ekf["events"]["reset_vel_to_flow"]
    np.testing.assert_allclose(ekf["vel"][:2], [2.0, 0.0], atol=1e-9)
    # σ = EKF2_OF_N_MIN at full quality, times the distance to the ground
    assert ekf["P"][VELOCITY, VELOCITY] == pytest.approx((0.15 * 10.0) ** 2, rel=1e-6)


def test_flow_continues_rejects_and_stops() -> None:
    params = parameters(EKF2_OF_CTRL=1)
    memory = hovering(params)
    ekf = memory[0]
    now = START_US
    for _ in range(11):
        now += 40_000
        _offer_flow(ekf, (0.0, -0.2), now)
        control_optical_flow_fusion(ekf, params[0])
    now += 40_000
    _offer_flow(ekf, (0.0, -0.21), now)
    control_optical_flow_fusion(ekf, params[0])
    assert ekf["aid"]["optical_flow"]["fused"]
    assert ekf["time_last_terrain_fuse"] == now

    # without data the flag stays for 7 s
    ekf["sensors"]["flow"]["data_ready"] = False
    set_time(ekf, now + 7_000_000)
    control_optical_flow_fusion(ekf, params[0])
    assert ekf["cs"]["opt_flow"]
    set_time(ekf, now + 7_000_001)
    control_optical_flow_fusion(ekf, params[0])
    assert not ekf["cs"]["opt_flow"]
    assert not ekf["cs"]["opt_flow_terrain"]


def test_flow_outside_the_sensors_range_stops() -> None:
    params = parameters(EKF2_OF_CTRL=1)
    memory = hovering(params)
    ekf = memory[0]
    for i in range(11):
        _offer_flow(ekf, (0.0, -0.2), START_US + 40_000 * i)
        control_optical_flow_fusion(ekf, params[0])
    ekf["gpos_alt"] = 10.1
    _offer_flow(ekf, (0.0, -0.2), START_US + 500_000)
    control_optical_flow_fusion(ekf, params[0])
    assert not ekf["cs"]["opt_flow"]


def test_flow_gyro_bias_follows_the_imu_within_its_step_limit() -> None:
    params = parameters(EKF2_OF_CTRL=1)
    memory = hovering(params)
    ekf = memory[0]
    _offer_flow(ekf, (0.0, 0.0), START_US)
    ekf["sensors"]["flow"]["sample"]["gyro_rate"] = [0.05, 3.0, np.nan]
    control_optical_flow_fusion(ekf, params[0])
    np.testing.assert_allclose(ekf["flow"]["gyro_bias"], [0.01 * 0.05, 0.01 * 0.1, 0.0], atol=1e-12)

    internal = parameters(EKF2_OF_CTRL=1, EKF2_OF_GYR_SRC=1)
    memory = hovering(internal)
    _offer_flow(memory[0], (0.0, 0.0), START_US)
    memory[0]["sensors"]["flow"]["sample"]["gyro_rate"] = [0.05, 3.0, 1.0]
    control_optical_flow_fusion(memory[0], internal[0])
    np.testing.assert_array_equal(memory[0]["flow"]["gyro_bias"], 0.0)


def _offer_airspeed(ekf: np.void, speed: float, time_us: int) -> None:
    set_time(ekf, time_us)
    ekf["sensors"]["airspeed"]["data_ready"] = True
    ekf["sensors"]["airspeed"]["sample"]["time_us"] = time_us
    ekf["sensors"]["airspeed"]["sample"]["true_airspeed"] = speed
    ekf["sensors"]["airspeed"]["sample"]["eas2tas"] = 1.0


def _fixed_wing(params: np.ndarray, velocity: list[float]) -> np.void:
    """In level flight to the north, at a velocity (NED, m/s)."""
    ekf = hovering(params)[0]
    ekf["cs"]["fixed_wing"] = True
    ekf["vel"] = velocity
    return ekf


def test_airspeed_starts_with_the_wind_of_level_flight() -> None:
    """North at 20 m/s over ground, heading north, 15 m/s through the air: a tailwind of 5 m/s."""
    params = parameters(EKF2_ARSP_THR=8.0)
    ekf = _fixed_wing(params, [20.0, 0.0, 0.0])
    _offer_airspeed(ekf, 15.0, START_US)
    control_air_data_fusion(ekf, params[0])
    assert ekf["cs"]["fuse_aspd"]
    assert ekf["cs"]["wind"]
    np.testing.assert_allclose(ekf["wind_vel"], [5.0, 0.0], atol=1e-12)
    along = ekf["P"][VELOCITY, VELOCITY] + 1.4**2
    across = ekf["P"][VELOCITY + 1, VELOCITY + 1] + 15.0**2 * (0.01 + math.radians(15.0) ** 2)
    assert ekf["P"][WIND, WIND] == pytest.approx(along, rel=1e-6)
    assert ekf["P"][WIND + 1, WIND + 1] == pytest.approx(across, rel=1e-6)

    velocity = ekf["vel"].copy()
    _offer_airspeed(ekf, 15.5, START_US + 100_000)
    control_air_data_fusion(ekf, params[0])
    assert ekf["aid"]["airspeed"]["fused"]
    np.testing.assert_array_equal(ekf["vel"], velocity)
    assert ekf["wind_vel"][0] < 5.0
    assert ekf["gsf"]["true_airspeed"] == 15.5


def test_slow_airspeed_is_ignored_and_data_stop_after_a_second() -> None:
    params = parameters(EKF2_ARSP_THR=8.0)
    memory = hovering(params)
    ekf = memory[0]
    ekf["vel"] = [20.0, 0.0, 0.0]
    _offer_airspeed(ekf, 7.9, START_US)
    control_air_data_fusion(ekf, params[0])
    assert not ekf["cs"]["fuse_aspd"]
    _offer_airspeed(ekf, 15.0, START_US + 100_000)
    control_air_data_fusion(ekf, params[0])
    assert ekf["cs"]["fuse_aspd"]
    ekf["sensors"]["airspeed"]["data_ready"] = False
    set_time(ekf, START_US + 100_000 + 999_999)
    control_air_data_fusion(ekf, params[0])
    assert ekf["cs"]["fuse_aspd"]
    set_time(ekf, START_US + 100_000 + 1_000_000)
    control_air_data_fusion(ekf, params[0])
    assert not ekf["cs"]["fuse_aspd"]
    assert math.isnan(ekf["gsf"]["true_airspeed"])


def test_sideslip_runs_every_150_ms_in_fixed_wing_flight() -> None:
    params = parameters(EKF2_FUSE_BETA=1)
    memory = hovering(params)
    ekf = memory[0]
    ekf["vel"] = [15.0, 1.0, 0.0]
    control_beta_fusion(ekf, params[0])
    assert not ekf["cs"]["fuse_beta"]
    ekf["cs"]["fixed_wing"] = True
    fused = []
    for i in range(40):
        set_time(ekf, START_US + 10_000 * i)
        control_beta_fusion(ekf, params[0])
        fused.append(int(ekf["aid"]["sideslip"]["time_last_fuse"] == ekf["time_delayed_us"]))
    assert ekf["cs"]["wind"]
    # later than 150 ms after the last, at updates 10 ms apart
    assert np.flatnonzero(fused).tolist() == [0, 16, 32]


def test_wind_is_given_up_ten_seconds_after_the_last_observation() -> None:
    params = parameters(EKF2_FUSE_BETA=1)
    ekf = _fixed_wing(params, [15.0, 1.0, 0.0])
    control_beta_fusion(ekf, params[0])
    for elapsed, expected in ((10_000_000, True), (10_000_001, False)):
        set_time(ekf, START_US + elapsed)
        control_air_data_fusion(ekf, params[0])
        assert ekf["cs"]["wind"] == expected


def test_drag_estimates_the_headwind_of_a_hover() -> None:
    """A hover that feels 1.5 m/s² backwards along X, with 0.15/s of momentum drag alone, stands in 10 m/s of wind."""
    params = parameters(EKF2_DRAG_CTRL=1, EKF2_BCOEF_X=0.0, EKF2_BCOEF_Y=0.0, EKF2_MCOEF=0.15)
    memory = hovering(params)
    ekf = memory[0]
    ekf["P"][WIND, WIND] = ekf["P"][WIND + 1, WIND + 1] = 100.0
    ekf["sensors"]["drag"]["exists"] = True
    ekf["sensors"]["drag"]["data_ready"] = True
    ekf["cs"]["wind"] = True
    for i in range(400):
        set_time(ekf, START_US + 25_000 * i)
        ekf["sensors"]["drag"]["sample"]["time_us"] = START_US + 25_000 * i
        ekf["sensors"]["drag"]["sample"]["accel_xy"] = [-1.5, 0.0]
        control_drag_fusion(ekf, params[0])
        ekf["vel"] = 0.0
        ekf["accel_bias"] = 0.0
        ekf["q"] = [1.0, 0.0, 0.0, 0.0]
        ekf["R_to_earth"] = np.eye(3)
    assert ekf["wind_vel"][0] == pytest.approx(-10.0, abs=1.0)
    assert ekf["wind_vel"][1] == pytest.approx(0.0, abs=0.1)


def test_drag_starts_the_wind_in_flight_only() -> None:
    params = parameters(EKF2_DRAG_CTRL=1)
    memory = hovering(params)
    ekf = memory[0]
    ekf["sensors"]["drag"]["exists"] = True
    ekf["cs"]["in_air"] = False
    control_drag_fusion(ekf, params[0])
    assert not ekf["cs"]["wind"]
    ekf["cs"]["in_air"] = True
    control_drag_fusion(ekf, params[0])
    assert ekf["cs"]["wind"]
    assert ekf["P"][WIND, WIND] == 1.0


def test_drag_samples_are_means_of_five_imu_samples() -> None:
    drag = np.zeros(1, DRAG_ACCUMULATOR)[0]
    imu = np.zeros(1, IMU_ROW)
    imu["delta_vel_dt"] = 0.005
    produced = []
    for i in range(12):
        imu["time_us"] = 1_000_000 + 5_000 * i
        imu["delta_vel"] = [[0.005 * i, -0.005, 0.0]]
        imu["delta_vel_clipping"] = 1 if i == 6 else 0
        produced.append(accumulate_drag(drag, imu[0], 20, 20))
        if i == 4:
            np.testing.assert_allclose(drag["produced"]["accel_xy"], [2.0, -1.0], rtol=1e-6)
            assert drag["produced"]["time_us"] == 1_010_000
    # the clipped seventh sample discards the sixth, too
    assert np.flatnonzero(produced).tolist() == [4, 11]


def test_external_wind_is_taken_on_ground_only() -> None:
    params = parameters()
    memory = hovering(params)
    ekf = memory[0]
    reset_wind_to_external_observation(ekf, 5.0, math.pi / 2.0, 0.1, 0.02)
    np.testing.assert_array_equal(ekf["wind_vel"], 0.0)
    ekf["cs"]["in_air"] = False
    reset_wind_to_external_observation(ekf, 5.0, math.pi / 2.0, 0.1, 0.02)
    np.testing.assert_allclose(ekf["wind_vel"], [0.0, 5.0], atol=1e-12)
    # along the wind the speed's variance, across it that of the direction
    assert ekf["P"][WIND + 1, WIND + 1] == pytest.approx(0.1**2, rel=1e-9)
    assert ekf["P"][WIND, WIND] == pytest.approx((5.0 * 0.02) ** 2, rel=1e-9)
    assert ekf["wind"]["external_init"]


def test_flow_moves_the_terrain_unless_height_is_measured_from_it() -> None:
    for reference, moved in ((0, True), (2, False)):
        params = parameters(EKF2_OF_CTRL=1)
        memory = hovering(params)
        ekf = memory[0]
        ekf["height_sensor_ref"] = reference
        ekf["cs"]["opt_flow"] = True
        ekf["aid"]["optical_flow"]["time_last_fuse"] = START_US
        ekf["vel"] = [3.0, 0.0, 0.0]
        ekf["P"][TERRAIN, TERRAIN] = 4.0
        _offer_flow(ekf, (0.0, -0.33), START_US + 40_000)
        control_optical_flow_fusion(ekf, params[0])
        assert ekf["aid"]["optical_flow"]["fused"]
        assert (ekf["terrain"] != 0.0) == moved
