"""What the core of v1.13 does otherwise than v1.14's.

Expected: the formulas of docs/releases.md, worked out here, and the starting rules of `initialiseFilter`, run by run.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.ekf2.filter.aiding_estimator import START_US
from tests.ekf2.releases.test_named_behaviours import Flying, asked, flying
from tests.ekf2.replay.test_flight_schedule import Arrival, inputs_of

from fusetune.ekf2.compiled.compilation import ensure_compiled
from fusetune.ekf2.feed.sensor_samples import SYSTEM_FLAGS_SAMPLE
from fusetune.ekf2.filter import (
    bias_inhibition,
    estimator,
    measurement_update,
    observation_gain,
    prediction,
    sample_start,
)
from fusetune.ekf2.filter.aid_sources.gravity import gravity_fusion
from fusetune.ekf2.filter.common.conditions import follow_system_flags_at_once
from fusetune.ekf2.filter.common.parameters import complete, parameter_record
from fusetune.ekf2.filter.common.state import ACCEL_BIAS, VELOCITY, WIND
from fusetune.ekf2.filter.quaternion_core import quaternion_prediction
from fusetune.ekf2.replay.flight_schedule import flight_schedule
from fusetune.ekf2.schedule.sensor_actions import DUE
from fusetune.ekf2.schedule.starting_samples import low_passed
from fusetune.ekf2.schedule.taking_actions import BARO, MAG, SYSTEM_FLAGS
from fusetune.ekf2.schedule.updates import levelling_record
from fusetune.px4 import releases

V113, V114 = "v1.13", "v1.14"
DT = 0.01


@pytest.fixture(params=[V113, V114])
def it(request: pytest.FixtureRequest) -> Flying:
    made = flying(request.param)
    made.ekf["quaternion"]["mean_dt"] = made.ekf["dt_ekf_avg"] = DT
    return made


def is_old(it: Flying) -> bool:
    return "EKF2_WIND_NOISE" in it.params.dtype.names


@pytest.mark.parametrize(("release", "first"), [(V113, "state"), (V114, "covariance")])
def test_the_state_is_predicted_before_the_covariance(release, first, monkeypatch):
    done = []
    for name in ("predict_state", "predict_covariance"):
        monkeypatch.setattr(estimator, name, lambda *_, name=name: done.append(name.removeprefix("predict_")))
    for name in ("update_imu_bias_inhibit", "control_fusion_modes", "run_terrain_filter", "correct_output"):
        monkeypatch.setattr(estimator, name, lambda *_: None)
    asked(estimator.update, flying(release), None)
    assert done[0] == first
    assert len(done) == 2


def test_increments_of_biases_are_taken_off_as_they_are(it):
    it.ekf["gyro_bias"] = 2e-3, 0.0, 0.0
    # over twice the mean interval
    rate = asked(prediction._gyro_bias_over, it, 0.02)[0]
    assert math.isclose(rate * 0.02, 2e-3 if is_old(it) else 4e-3)


def test_the_gyro_s_bias_is_learnt_always_and_the_accelerometer_s_by_the_mask(it):
    it.params["EKF2_IMU_CTRL"] = 0.0
    it.ekf["cs"]["fake_hgt"] = True
    asked(bias_inhibition.update_imu_bias_inhibit, it, it.params)
    assert it.ekf["gyro_bias_inhibit"].tolist() == ([0, 0, 0] if is_old(it) else [1, 1, 1])
    assert it.ekf["accel_bias_inhibit"].tolist() == ([0, 0, 0] if is_old(it) else [1, 1, 1])
    if is_old(it):
        it.params["EKF2_AID_MASK"] = 4.0
        asked(bias_inhibition.update_imu_bias_inhibit, it, it.params)
        assert it.ekf["accel_bias_inhibit"].tolist() == [1, 1, 1]
    it.ekf["gyro_bias"] = 1.0
    it.params["EKF2_GYR_B_LIM"] = 0.1
    asked(prediction._finish_prediction, it, it.params)
    assert np.allclose(it.ekf["gyro_bias"], (math.radians(20.0) if is_old(it) else 0.1) * DT)


def test_wind_noise_is_by_update(it):
    it.ekf["cs"]["wind"], it.ekf["height_rate_lpf"] = True, 2.0
    noise = quaternion_prediction._wind_noise.py_func(it.ekf, it.params, DT)
    if is_old(it):
        assert math.isclose(noise, (DT * it.params["EKF2_WIND_NOISE"] * 2.0) ** 2)
    else:
        assert math.isclose(noise, (it.params["EKF2_WIND_NSD"] * 2.0) ** 2 * DT)


def test_gravity_is_not_fused(it):
    asked(gravity_fusion.control_gravity_fusion, it, it.params)
    assert (it.ekf["aid"]["gravity"]["timestamp_sample"] == 0) == is_old(it)


def test_states_without_gain_lose_half_of_their_covariances(it):
    root = np.random.default_rng(3).normal(size=(24, 24)) * 0.01
    it.ekf["P"] = before = root @ root.T
    it.ekf["cs"]["mag_3d"] = it.ekf["cs"]["wind"] = True
    H = np.zeros(24)
    H[VELOCITY], H[WIND] = 1.0, -1.0
    S = float(H @ before @ H) + 0.1
    K, PH = before @ H / S, before @ H
    observation_gain.compute_kalman_gain.py_func(it.ekf, H, S)
    it.ekf["scratch"]["K"][:VELOCITY] = K[:VELOCITY] = 0.0
    rotation = np.array(it.ekf["R_to_earth"])
    assert asked(measurement_update.measurement_update, it, it.params, 0.1, 0.5)
    taken_off = 0.5 * (np.outer(K, PH) + np.outer(PH, K)) if is_old(it) else np.outer(K, K) * S
    free = [i for i in range(24) if not ACCEL_BIAS <= i < ACCEL_BIAS + 3]
    assert np.allclose(it.ekf["P"][np.ix_(free, free)], (before - taken_off)[np.ix_(free, free)], atol=1e-15)
    # the rotation matrix waits for the next prediction
    H[:] = 0.0
    H[0] = 1.0
    observation_gain.compute_kalman_gain.py_func(it.ekf, H, it.ekf["P"][0, 0] + 0.1)
    it.ekf["scratch"]["K"][1] = 0.2
    asked(measurement_update.measurement_update, it, it.params, 0.1, 0.5)
    assert np.array_equal(it.ekf["R_to_earth"], rotation) == is_old(it)


def test_flags_act_as_they_arrive_each_on_its_own():
    it = flying(V113)
    flags = np.zeros(1, SYSTEM_FLAGS_SAMPLE)[0]
    flags["is_fixed_wing"], flags["at_rest"], flags["in_air"] = True, True, False
    it.ekf["time_last_on_ground"] = 7
    flags["status_is_new"] = True
    follow_system_flags_at_once(it.ekf, flags)
    cs = it.ekf["cs"]
    assert cs["fixed_wing"]
    assert not cs["vehicle_at_rest"]
    assert cs["in_air"]
    flags["land_is_new"] = True
    follow_system_flags_at_once(it.ekf, flags)
    assert cs["vehicle_at_rest"]
    assert not cs["in_air"]
    assert it.ekf["time_last_on_ground"] == START_US
    # the time is that of the change
    it.ekf["time_delayed_us"] += 10
    follow_system_flags_at_once(it.ekf, flags)
    assert it.ekf["time_last_on_ground"] == START_US


def test_tilt_heading_and_field_at_the_start():
    it = flying(V113, EKF2_MAG_TYPE=0.0, EKF2_MAG_DECL=3.0, EKF2_DECL_TYPE=0.0)
    roll, pitch = 0.1, -0.2
    levelling = np.zeros(1, levelling_record(V113))
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    level = np.array([[cp, sr * sp, cr * sp], [0.0, cr, -sr], [-sp, sr * cp, cr * cp]])
    levelling["accel"] = level.T @ [0.0, 0.0, -9.8]
    levelling["mag"] = level.T @ [0.2, -0.1, 0.4]
    levelling["mag_count"], levelling["baro_count"] = 5, 6
    levelling["baro_offset"], levelling["baro_height"], levelling["baro_time_us"] = 488.0, 488.2, 77
    sample_start.start_by_angles_and_field.py_func(it.ekf, it.params, levelling.view(np.recarray)[0])
    yaw = math.atan2(0.1, 0.2) + math.radians(3.0)
    turn = np.array([[math.cos(yaw), -math.sin(yaw), 0.0], [math.sin(yaw), math.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    assert np.allclose(it.ekf["R_to_earth"], turn @ level)
    assert np.allclose(it.ekf["mag_I"], turn @ [0.2, -0.1, 0.4])
    assert it.ekf["cs"]["baro_hgt"]
    assert it.ekf["baro"]["lpf"] == 488.0
    assert it.ekf["baro"]["counter"] == 6


def test_the_filter_starts_once_its_buffers_could_be_full_of_samples():
    ensure_compiled(V113)
    # 5 ms a run, intervals of two runs; 60 ms of delay are 6 places; magnetometer every 20 runs, barometer every 10
    mags, baros = [Arrival(run, 0) for run in range(5, 600, 20)], [Arrival(run, 0) for run in range(3, 600, 10)]
    inputs = inputs_of({"mag": mags, "baro": baros, "system_flags": [Arrival(450, 0)]}, [5_000] * 600)
    inputs.arrays.mag["mag"] = np.arange(len(mags))[:, None]
    inputs.arrays.baro["hgt"] = np.arange(len(baros))
    wanted = {"EKF2_AID_MASK": 0.0, "EKF2_HGT_MODE": 0.0, "EKF2_MAG_TYPE": 0.0, "EKF2_AVEL_DELAY": 60.0}
    wanted |= {"SENS_BARO_RATE": 100.0, "SENS_MAG_RATE": 100.0, "EKF2_BARO_DELAY": 0.0, "EKF2_ARSP_THR": 0.0}
    values = complete({}, {}, releases.number_of_name(V113)) | wanted
    schedule = flight_schedule(inputs, parameter_record(values, V113)[0], (), release=V113)
    lengths, levelling, updates = schedule.tables.lengths, schedule.tables.levelling, schedule.tables.updates
    assert lengths["imu_length"][0] == 6
    assert lengths["observation_length"][0] == 6
    # the sixth sample of the magnetometer, of run 105, less half an interval, is passed by the horizon 5 intervals on
    earliest = int(levelling["earliest_run"][0])
    assert 105 + 9 <= earliest <= 105 + 12
    assert levelling["mag_count"][0] == 6
    assert updates["run"][0] - earliest <= 1
    assert np.allclose(levelling["mag"][0], low_passed(np.arange(6.0)))
    due = schedule.tables.actions[schedule.tables.actions["what"] == DUE]
    assert due["slot"][due["sensor"] == MAG][0] == 6
    assert due["slot"][due["sensor"] == BARO][0] == levelling["baro_count"][0]
    # flags come at the first update from their arrival on
    flag = due[due["sensor"] == SYSTEM_FLAGS][0]
    assert updates["run"][flag["update"]] >= 450 > updates["run"][flag["update"] - 1]


def test_low_passed_values_start_with_the_first():
    assert low_passed(np.array([1.0, 2.0])) == 1.1
