"""What each fault adds to the sensors that every vehicle has, by hand calculation."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from fusetune.execute.right_values import right_values
from fusetune.execute.sensors.barometer import vehicle_air_data
from fusetune.execute.sensors.faults import (
    AccelerometerBias,
    AliasedVibration,
    BarometerDrift,
    BodyField,
    Clipping,
    Fault,
    GnssAccuracy,
    GnssInterference,
    GroundEffect,
    GyroBias,
    ImuGaps,
    MagnetometerRotation,
    MagnetometerScale,
    MotorField,
    PropellerWash,
    SensorStuck,
    StaticPressure,
)
from fusetune.execute.sensors.gnss import vehicle_gps_position
from fusetune.execute.sensors.imu import inertial_topics, sensor_combined
from fusetune.execute.sensors.magnetometer import magnetometer_errors, vehicle_magnetometer
from fusetune.execute.sensors.stuck import stick
from fusetune.execute.vehicle import Battery, OpticalFlow, Vehicle
from fusetune.execute.world.truth import Truth
from fusetune.px4.flight import TopicTable, stacked

SEED = 7
UNDULATION_M = 47.4
G_M_S2 = 9.80665


def gnss(truth: Truth, vehicle: Vehicle, *faults: Fault) -> TopicTable:
    return vehicle_gps_position(truth, vehicle.gnss, vehicle.environment, UNDULATION_M, faults, SEED)


def field(truth: Truth, vehicle: Vehicle, *faults: Fault) -> np.ndarray:
    return stacked(
        vehicle_magnetometer(truth, vehicle.magnetometer, vehicle.environment, faults, SEED), "magnetometer_ga"
    )


def added_height(truth: Truth, vehicle: Vehicle, fault: Fault) -> tuple[np.ndarray, np.ndarray]:
    """Sample times and what a fault adds to the barometer's height."""
    plain = vehicle_air_data(truth, vehicle.barometer, UNDULATION_M, (), SEED)
    faulty = vehicle_air_data(truth, vehicle.barometer, UNDULATION_M, (fault,), SEED)
    return plain["timestamp_sample"], faulty["baro_alt_meter"].astype(float) - plain["baro_alt_meter"]


def added_inertial(truth: Truth, vehicle: Vehicle, fault: Fault, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Sample times and what a fault adds to a reading."""
    plain, faulty = (sensor_combined(truth, vehicle.imu, faults, SEED) for faults in ((), (fault,)))
    return plain["timestamp"], stacked(faulty, name).astype(float) - stacked(plain, name)


def test_body_and_motor_fields_add_to_the_reading(truth: Truth, vehicle: Vehicle) -> None:
    plain = field(truth, vehicle)
    assert field(truth, vehicle, BodyField((0.1, -0.05, 0.2))) - plain == pytest.approx(
        np.tile([0.1, -0.05, 0.2], (len(plain), 1)), abs=1e-6
    )
    table = vehicle_magnetometer(truth, vehicle.magnetometer, vehicle.environment, (), SEED)
    thrust = truth.at(table["timestamp_sample"], truth.rotor_speed) ** 2
    added = field(truth, vehicle, MotorField((0.0, 0.06, 0.0))) - plain
    assert added[:, 1] == pytest.approx(0.06 * thrust, abs=1e-6)


def test_mounted_and_scaled_wrongly(truth: Truth, vehicle: Vehicle) -> None:
    plain = field(truth, vehicle)
    # a sensor turned clockwise by a quarter has its forward axis to the right, and its right axis backward
    turned = field(truth, vehicle, MagnetometerRotation(yaw_deg=90.0))
    assert turned == pytest.approx(np.column_stack([plain[:, 1], -plain[:, 0], plain[:, 2]]), abs=1e-6)
    upside_down = field(truth, vehicle, MagnetometerRotation(roll_deg=180.0))
    assert upside_down == pytest.approx(plain * [1.0, -1.0, -1.0], abs=1e-6)
    assert field(truth, vehicle, MagnetometerScale((0.8, 1.1, 1.0))) == pytest.approx(plain * [0.8, 1.1, 1.0], abs=1e-6)


def test_static_pressure_takes_height_with_the_square_of_the_airspeed(truth: Truth, vehicle: Vehicle) -> None:
    at_us, added = added_height(truth, vehicle, StaticPressure(forward=0.3, backward=-0.1, left=0.2, vertical=0.05))
    velocity = truth.at(at_us, truth.velocity - truth.wind)
    x, y, z = truth.attitude_at(at_us).inv().apply(velocity).T
    shares = np.where(x >= 0, 0.3, -0.1) * x**2 + np.where(y >= 0, 0.0, 0.2) * y**2 + 0.05 * z**2
    # 0.3 of the dynamic pressure at 8 m/s weighs as much as 0.3 * 64 / (2 * 9.80665) = 0.979 m of air
    assert added == pytest.approx(-shares / (2.0 * G_M_S2), abs=1e-4)
    assert added.min() < -0.3


def test_wash_drift_and_ground_effect_of_the_barometer(truth: Truth, vehicle: Vehicle) -> None:
    at_us, added = added_height(truth, vehicle, PropellerWash(-2.0))
    thrust = truth.at(at_us, truth.rotor_speed) ** 2
    assert added == pytest.approx(-2.0 * thrust, abs=1e-3)
    _, drifted = added_height(truth, vehicle, BarometerDrift(4.0, 10.0, 3.0))
    since_s = at_us * 1e-6 - truth.events.takeoff_s
    assert drifted[since_s < 4.0] == pytest.approx(0.0, abs=1e-4)
    assert np.interp(9.0, since_s, drifted) == pytest.approx(1.5, abs=0.01)
    assert drifted[since_s > 14.0] == pytest.approx(3.0, abs=1e-3)
    _, dipped = added_height(truth, vehicle, GroundEffect(3.0))
    height = np.maximum(-truth.at(at_us, truth.position)[:, 2], 0.0)
    # falls to 1/e over the 1.5 m of the vehicle's file
    assert dipped == pytest.approx(-3.0 * thrust * np.exp(-height / 1.5), abs=1e-3)


def test_gyro_bias_warms_up_and_accelerometer_bias_stays(truth: Truth, vehicle: Vehicle) -> None:
    at_us, turning = added_inertial(
        truth, vehicle, GyroBias((0.01, 0.0, 0.0), (0.0, 0.0, 0.1), warming_time_s=20.0), "gyro_rad"
    )
    since_s = (at_us - truth.timestamp_us[0]) * 1e-6
    assert turning[:, 0] == pytest.approx(0.01, abs=1e-4)
    assert np.interp(20.0, since_s, turning[:, 2]) == pytest.approx(0.1 * (1.0 - math.exp(-1.0)), abs=1e-3)
    _, pushing = added_inertial(truth, vehicle, AccelerometerBias((0.0, 0.2, -0.7)), "accelerometer_m_s2")
    assert pushing == pytest.approx(np.tile([0.0, 0.2, -0.7], (len(pushing), 1)), abs=1e-5)


def test_aliased_vibration_grows_with_the_square_of_the_thrust(truth: Truth, vehicle: Vehicle) -> None:
    at_us, added = added_inertial(truth, vehicle, AliasedVibration((0.0, 0.0, 1.5)), "accelerometer_m_s2")
    thrust = truth.at(at_us - 2_000, truth.rotor_speed) ** 2
    flying = (at_us * 1e-6 > truth.events.takeoff_s + 5.0) & (at_us * 1e-6 < truth.events.touchdown_s - 5.0)
    assert added[flying, 2] == pytest.approx(1.5 * thrust[flying] ** 2, rel=0.02)
    assert not added[at_us * 1e-6 < truth.events.armed_s].any()


def test_lost_imu_samples_leave_gaps_in_runs(truth: Truth, vehicle: Vehicle) -> None:
    samples = inertial_topics(truth, vehicle.imu, (ImuGaps(5.0, 15.0, share=0.1, longest=5),), SEED).samples
    whole = sensor_combined(truth, vehicle.imu, (), SEED)
    missing = ~np.isin(whole["timestamp"], samples["timestamp"])
    after_s = whole["timestamp"] * 1e-6 - truth.events.takeoff_s
    on = (after_s >= 5.0) & (after_s < 20.0)
    # runs of 3 on average overlap now and then
    assert missing[on].mean() == pytest.approx(0.1, abs=0.025)
    assert not missing[after_s < 5.0].any()
    assert np.diff(samples["timestamp"]).max() >= 5 * 4_000
    assert (samples["gyro_integral_dt"] == 4_000).all()


def test_imu_status_has_px4s_metrics_and_counts_clipped_raw_samples(truth: Truth, vehicle: Vehicle) -> None:
    topics = inertial_topics(truth, vehicle.imu, (Clipping(6.0, 1.0),), SEED)
    readings = stacked(topics.samples, "accelerometer_m_s2").astype(float)
    metric, expected = 0.0, {}
    for index in range(1, len(readings)):
        # VehicleIMU: 0.99 of the metric and 0.01 of the length of the change
        metric = 0.99 * metric + 0.01 * float(np.linalg.norm(readings[index] - readings[index - 1]))
        expected[int(topics.samples["timestamp"][index])] = metric
    status = topics.status
    told = [expected[int(time)] for time in status["timestamp"][1:]]
    assert status["accel_vibration_metric"][1:] == pytest.approx(told, rel=1e-4)
    last = np.searchsorted(topics.samples["timestamp"], status["timestamp"][1:])
    first = np.searchsorted(topics.samples["timestamp"], status["timestamp"][:-1]) + 1
    means = [readings[begin : end + 1, 2].mean() for begin, end in zip(first, last, strict=True)]
    assert status["mean_accel[2]"][1:] == pytest.approx(means, rel=1e-4)
    assert np.diff(status["timestamp"]) == pytest.approx(100_000)
    # 220 m/s² at 0.9 of it along z about -9.8: below -157 for a fifth of each wave of a second, above for less
    counts = status["accel_clipping[2]"].astype(int)
    assert counts[0] == 0
    assert 200 < counts[-1] < 500
    assert (np.diff(counts) >= 0).all()


def test_poor_accuracy_is_told_and_true(truth: Truth, vehicle: Vehicle) -> None:
    plain, worse = gnss(truth, vehicle), gnss(truth, vehicle, GnssAccuracy(5.0, 10.0, 6.0))
    after_s = (plain["timestamp"] - 110_000) * 1e-6 - truth.events.takeoff_s
    on, off = (after_s > 5.1) & (after_s < 14.9), (after_s < 4.9) | (after_s > 15.1)
    for name in ("eph", "epv", "s_variance_m_s"):
        assert worse[name][on] == pytest.approx(6.0 * plain[name][on], rel=1e-5)
        assert np.array_equal(worse[name][off], plain[name][off])
    measured_us = plain["timestamp"]
    true = truth.at(measured_us - 110_000, truth.velocity)[:, 0]
    # the delay's jitter of 3 ms and the antenna's motion are the rest of the difference
    assert np.std((worse["vel_n_m_s"] - true)[on]) > 3.0 * np.std((plain["vel_n_m_s"] - true)[on])


def test_a_jammer_shows_in_all_that_a_receiver_reports(truth: Truth, vehicle: Vehicle) -> None:
    plain, jammed = gnss(truth, vehicle), gnss(truth, vehicle, GnssInterference(5.0, 12.0, 0.9))
    after_s = (plain["timestamp"] - 110_000) * 1e-6 - truth.events.takeoff_s
    on, off = (after_s > 5.1) & (after_s < 16.9), (after_s < 4.9) | (after_s > 17.1)
    # 12 + 0.9 (220 - 12), 90 + 0.9 (210 - 90)
    assert (jammed["jamming_indicator"][on] == 199).all()
    assert (jammed["noise_per_ms"][on] == 198).all()
    assert (jammed["jamming_state"][on] == 3).all()
    fixed = jammed["fix_type"] == 3
    assert 0.1 < (~fixed[on]).mean() < 0.9
    # 17 satellites of which 0.65 * 0.9 are lost
    assert np.median(jammed["satellites_used"][on & fixed]) == pytest.approx(7.0, abs=1.0)
    for name, values in plain.items():
        assert np.array_equal(jammed[name][off], values[off], equal_nan=values.dtype.kind == "f"), name


def test_a_stuck_sensor_repeats_its_last_reading(truth: Truth, vehicle: Vehicle) -> None:
    plain = vehicle_air_data(truth, vehicle.barometer, UNDULATION_M, (), SEED)
    topics = {("vehicle_air_data", 0): plain}
    stick(topics, truth.events.takeoff_s, (SensorStuck(5.0, 8.0, "barometer"), SensorStuck(5.0, 8.0, "gnss")))
    stuck = topics["vehicle_air_data", 0]
    after_s = plain["timestamp"] * 1e-6 - truth.events.takeoff_s
    on = (after_s >= 5.0) & (after_s < 13.0)
    before = np.flatnonzero(on)[0] - 1
    assert (stuck["baro_alt_meter"][on] == plain["baro_alt_meter"][before]).all()
    assert np.array_equal(stuck["timestamp"], plain["timestamp"])
    assert np.array_equal(stuck["baro_alt_meter"][~on], plain["baro_alt_meter"][~on])


def test_right_values_are_those_of_the_file_and_the_faults(vehicle: Vehicle) -> None:
    flow = OpticalFlow(50.0, 0.0, 0.0, 220, 7.4, 30.0, (0.1, 0.0, 0.03), 0.2, 35.0)
    described = dataclasses.replace(vehicle, optical_flow=flow, battery=Battery(4, 21.0, 0.5, 0.02, 0.0))
    faults = (StaticPressure(forward=0.3, left=-0.1), GroundEffect(2.0), MotorField((0.042, 0.0, 0.0)))
    right = right_values(described, faults, SEED, 488.0)
    assert right["EKF2_GPS_DELAY"] == 110.0
    assert right["EKF2_OF_DELAY"] == 35.0
    assert right["EKF2_OF_POS_X"] == pytest.approx(0.1)
    assert "EKF2_RNG_DELAY" not in right
    # ISO 2533 at 488 m: 1.1685 kg/m³
    assert right["EKF2_BCOEF_X"] == pytest.approx(0.5 * 1.1685 / 0.012, rel=1e-3)
    assert right["EKF2_MCOEF"] == pytest.approx(0.25 / math.sqrt(1.1685 / 1.225), rel=1e-3)
    assert right["EKF2_PCOEF_XP"] == pytest.approx(0.3)
    assert right["EKF2_PCOEF_YN"] == pytest.approx(-0.1)
    assert right["EKF2_GND_EFF_DZ"] == pytest.approx(2.8)
    drawn = magnetometer_errors(vehicle.magnetometer, (), SEED).motor_field[0]
    assert right["motor_field_x_gauss_per_throttle"] == pytest.approx((0.042 + drawn) / 0.42)
    assert right["motor_field_x_gauss_per_a"] == pytest.approx((0.042 + drawn) / 21.0)
    assert right["gyro_noise_density_rad_s_per_root_hz"] == pytest.approx(0.00012)
    assert right["gyro_bias_instability_rad_s"] == 0.0


def test_a_wandering_bias_has_its_deviation_and_time_and_the_allan_peak_that_is_told(
    truth: Truth, ideal_imu_vehicle: Vehicle
) -> None:
    gyro = dataclasses.replace(ideal_imu_vehicle.imu.gyro, bias_wander=0.02, bias_wander_time_s=0.5)
    imu = dataclasses.replace(ideal_imu_vehicle.imu, gyro=gyro)
    wander = [
        stacked(sensor_combined(truth, one, (), SEED), "gyro_rad").astype(float) for one in (imu, ideal_imu_vehicle.imu)
    ]
    bias = wander[0] - wander[1]
    # a hundred correlation times of three axes: the deviation is known to about 6 %
    assert bias.std() == pytest.approx(0.02, rel=0.15)
    lag = int(0.5 * imu.rate_hz)
    assert np.mean(bias[lag:] * bias[:-lag]) / 0.02**2 == pytest.approx(math.exp(-1.0), abs=0.15)
    # Allan deviation at 1.89 correlation times, from means over neighbouring intervals
    span = int(1.89 * 0.5 * imu.rate_hz)
    sums = np.cumsum(bias, axis=0)
    means = (sums[span:] - sums[:-span]) / span
    allan = math.sqrt(0.5 * float(np.mean((means[span:] - means[:-span]) ** 2)))
    right = right_values(dataclasses.replace(ideal_imu_vehicle, imu=imu), (), SEED, 488.0)
    assert allan == pytest.approx(right["gyro_bias_instability_rad_s"], rel=0.15)


def test_told_errors_of_the_magnetometer_are_those_in_its_samples(truth: Truth, vehicle: Vehicle) -> None:
    """Without noise the difference to a magnetometer without errors is the constant that is told, soft iron apart."""
    exact = dataclasses.replace(vehicle.magnetometer, noise_gauss=0.0, soft_iron=0.0, current_gauss=0.0)
    perfect = dataclasses.replace(exact, hard_iron_gauss=0.0)
    there, absent = (
        stacked(vehicle_magnetometer(truth, one, vehicle.environment, (), SEED), "magnetometer_ga")
        for one in (exact, perfect)
    )
    told = magnetometer_errors(exact, (), SEED).hard_iron
    assert there - absent == pytest.approx(np.tile(told, (len(there), 1)), abs=1e-6)
