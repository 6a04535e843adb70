"""Magnetometer, barometer and GNSS: on the truth, with the errors configured."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from fusetune.design.missions.mission import Mission
from fusetune.execute.noise import gauss_markov, random_stream, random_walk
from fusetune.execute.sensors.barometer import vehicle_air_data
from fusetune.execute.sensors.faults import GnssGlitch, GnssOutage, MagneticDisturbance
from fusetune.execute.sensors.gnss import vehicle_gps_position
from fusetune.execute.sensors.magnetometer import vehicle_magnetometer
from fusetune.execute.vehicle import GnssError, Vehicle
from fusetune.execute.world.earth import magnetic_field_ned
from fusetune.execute.world.truth import Truth
from fusetune.px4.flight import TopicTable, stacked

SEED = 7
UNDULATION_M = 47.4


def gnss_table(truth: Truth, vehicle: Vehicle, faults: tuple = (), seed: int = SEED) -> TopicTable:
    return vehicle_gps_position(truth, vehicle.gnss, vehicle.environment, UNDULATION_M, faults, seed)


def errorless(vehicle: Vehicle) -> Vehicle:
    none = GnssError(0.0, 0.0, 1.0, 1.0)
    gnss = dataclasses.replace(
        vehicle.gnss, position=none, velocity=none, delay_jitter_ms=0.0, antenna_position_m=(0.0, 0.0, 0.0)
    )
    magnetometer = dataclasses.replace(
        vehicle.magnetometer, noise_gauss=0.0, hard_iron_gauss=0.0, soft_iron=0.0, current_gauss=0.0
    )
    barometer = dataclasses.replace(
        vehicle.barometer, noise_m=0.0, drift_m=0.0, drift_rate_m_s=0.0, offset_m=0.0, ground_effect_m=0.0
    )
    return dataclasses.replace(vehicle, gnss=gnss, magnetometer=magnetometer, barometer=barometer)


def test_gauss_markov_has_its_deviation_and_autocorrelation() -> None:
    samples = gauss_markov(random_stream(1, "test"), 200_000, 1, 0.2, 0.5, 4.0)[:, 0]
    assert samples.std() == pytest.approx(0.5, rel=0.03)
    for lag in (1, 10, 20, 40):
        measured = float(np.mean(samples[lag:] * samples[:-lag]) / 0.25)
        assert measured == pytest.approx(math.exp(-lag * 0.2 / 4.0), abs=0.04)


def test_gauss_markov_is_stationary_from_the_first_sample() -> None:
    first = gauss_markov(random_stream(2, "test"), 2, 20_000, 0.2, 0.5, 100.0)
    assert first.std(axis=1) == pytest.approx([0.5, 0.5], rel=0.03)


def test_random_walk_grows_with_the_root_of_time() -> None:
    walk = random_walk(random_stream(3, "test"), 1001, 4000, 0.1, 0.2)
    assert walk[0].std() == 0.0
    assert walk[-1].std() == pytest.approx(0.2 * math.sqrt(100.0), rel=0.05)


def test_errorless_gnss_is_the_truth_at_the_time_of_measurement(truth: Truth, vehicle: Vehicle) -> None:
    table = gnss_table(truth, errorless(vehicle))
    measured_us = table["timestamp"] - round(vehicle.gnss.delay_ms * 1e3)
    lat, lon, height = truth.frame.to_geodetic(truth.at(measured_us, truth.position))
    assert (table["latitude_deg"] - np.degrees(lat)) * 111e3 == pytest.approx(0.0, abs=1e-4)
    assert (table["longitude_deg"] - np.degrees(lon)) * 75e3 == pytest.approx(0.0, abs=1e-4)
    assert table["altitude_ellipsoid_m"] == pytest.approx(height, abs=1e-4)
    assert table["altitude_msl_m"] == pytest.approx(height - UNDULATION_M, abs=1e-4)
    velocity = np.column_stack([table[f"vel_{axis}_m_s"] for axis in "ned"])
    assert velocity == pytest.approx(truth.at(measured_us, truth.velocity), abs=1e-3)


def test_gnss_errors_have_the_configured_statistics(truth: Truth, vehicle: Vehicle) -> None:
    clean = errorless(vehicle)
    exact = gnss_table(truth, clean)
    noisy_vehicle = dataclasses.replace(
        clean,
        gnss=dataclasses.replace(clean.gnss, position=vehicle.gnss.position, velocity=vehicle.gnss.velocity),
    )
    velocity_errors, position_errors = [], []
    for seed in range(60):
        noisy = gnss_table(truth, noisy_vehicle, seed=seed)
        velocity_errors.append([noisy[f"vel_{axis}_m_s"][::40] - exact_at(exact, noisy, axis)[::40] for axis in "ned"])
        position_errors.append([(noisy["altitude_msl_m"] - exact_altitude(truth, noisy))[::100]])
    configured = vehicle.gnss.velocity
    total = math.hypot(configured.noise, configured.correlated)
    errors = np.array(velocity_errors)
    assert errors[:, :2].std() == pytest.approx(total, rel=0.1)
    assert errors[:, 2].std() == pytest.approx(total * configured.vertical_factor, rel=0.15)
    position = vehicle.gnss.position
    expected = position.vertical_factor * math.hypot(position.noise, position.correlated)
    assert np.array(position_errors).std() == pytest.approx(expected, rel=0.2)


def exact_at(exact: TopicTable, noisy: TopicTable, axis: str) -> np.ndarray:
    return np.interp(noisy["timestamp"], exact["timestamp"], exact[f"vel_{axis}_m_s"])


def exact_altitude(truth: Truth, noisy: TopicTable) -> np.ndarray:
    _, _, height = truth.frame.to_geodetic(truth.at(noisy["timestamp"] - 110_000, truth.position))
    return height - UNDULATION_M


def test_antenna_off_the_imu_moves_with_the_body(truth: Truth, vehicle: Vehicle) -> None:
    clean = errorless(vehicle)
    arm = (0.5, -0.3, 0.2)
    moved = dataclasses.replace(clean, gnss=dataclasses.replace(clean.gnss, antenna_position_m=arm))
    at_imu, at_antenna = gnss_table(truth, clean), gnss_table(truth, moved)
    measured_us = at_imu["timestamp"] - 110_000
    offset = truth.attitude_at(measured_us).apply(arm)
    assert at_antenna["altitude_msl_m"] - at_imu["altitude_msl_m"] == pytest.approx(-offset[:, 2], abs=1e-3)
    # Its extra velocity is the derivative of the offset
    step_us = 2000
    derivative = (
        truth.attitude_at(measured_us + step_us).apply(arm) - truth.attitude_at(measured_us - step_us).apply(arm)
    ) / (2e-6 * step_us)
    assert at_antenna["vel_n_m_s"] - at_imu["vel_n_m_s"] == pytest.approx(derivative[:, 0], abs=2e-3)


def test_gnss_outage_reports_no_fix_or_nothing(truth: Truth, vehicle: Vehicle) -> None:
    plain = gnss_table(truth, vehicle)
    lost = gnss_table(truth, vehicle, (GnssOutage(5.0, 4.0),))
    gone = lost["fix_type"] < 3
    assert gone.sum() == pytest.approx(4.0 * vehicle.gnss.rate_hz, abs=1)
    assert not lost["vel_ned_valid"][gone].any()
    assert np.all(lost["eph"][gone] > 100.0)
    assert len(np.unique(lost["latitude_deg"][gone])) == 1
    silent = gnss_table(truth, vehicle, (GnssOutage(5.0, 4.0, silent=True),))
    assert len(plain["timestamp"]) - len(silent["timestamp"]) == gone.sum()
    assert np.diff(silent["timestamp"]).max() == pytest.approx(4.2e6, abs=0.05e6)


def test_gnss_glitch_moves_position_and_velocity_only_while_it_lasts(truth: Truth, vehicle: Vehicle) -> None:
    plain = gnss_table(truth, vehicle)
    fault = GnssGlitch(5.0, 4.0, offset_m=(0.0, 0.0, -8.0), velocity_offset_m_s=(1.0, 0.0, 0.0))
    off = gnss_table(truth, vehicle, (fault,))
    shift = off["altitude_msl_m"] - plain["altitude_msl_m"]
    assert sorted(set(np.round(shift, 3))) == [0.0, 8.0]
    assert np.allclose((off["vel_n_m_s"] - plain["vel_n_m_s"])[shift > 1.0], 1.0, atol=1e-5)


def test_errorless_magnetometer_sees_the_field_of_the_place(truth: Truth, vehicle: Vehicle) -> None:
    table = vehicle_magnetometer(truth, errorless(vehicle).magnetometer, vehicle.environment, (), SEED)
    attitude = truth.attitude_at(table["timestamp_sample"])
    field = attitude.apply(stacked(table, "magnetometer_ga"))
    expected = magnetic_field_ned(47.397742, 8.545594, 535.4, vehicle.environment.date)
    assert field == pytest.approx(np.tile(expected, (len(field), 1)), abs=1e-6)


def test_magnetic_disturbance_is_fixed_to_the_earth_and_limited_in_time(truth: Truth, vehicle: Vehicle) -> None:
    magnetometer = errorless(vehicle).magnetometer
    plain = vehicle_magnetometer(truth, magnetometer, vehicle.environment, (), SEED)
    fault = MagneticDisturbance(5.0, 6.0, (0.1, 0.0, 0.0))
    disturbed = vehicle_magnetometer(truth, magnetometer, vehicle.environment, (fault,), SEED)
    attitude = truth.attitude_at(plain["timestamp_sample"])
    extra = attitude.apply(stacked(disturbed, "magnetometer_ga") - stacked(plain, "magnetometer_ga"))
    after = plain["timestamp_sample"] * 1e-6 - truth.events.takeoff_s
    assert np.allclose(extra[(after < 5.0) | (after > 11.0)], 0.0, atol=1e-6)
    assert np.allclose(extra[(after > 6.0) & (after < 10.0)], [0.1, 0.0, 0.0], atol=1e-6)


def test_errorless_barometer_tells_the_altitude_and_a_consistent_atmosphere(truth: Truth, vehicle: Vehicle) -> None:
    table = vehicle_air_data(truth, errorless(vehicle).barometer, UNDULATION_M, (), SEED)
    altitude = 488.0 - truth.at(table["timestamp_sample"], truth.position[:, 2])
    assert table["baro_alt_meter"] == pytest.approx(altitude, abs=1e-3)
    # ICAO standard atmosphere at 500 m: 954.61 hPa and 1.1673 kg/m³
    near_500 = int(np.argmin(np.abs(altitude - 500.0)))
    assert table["baro_pressure_pa"][near_500] == pytest.approx(95461.0 - 11.4 * (altitude[near_500] - 500.0), abs=10.0)
    assert table["rho"][near_500] == pytest.approx(1.1673, abs=2e-3)


def test_rotor_wash_makes_the_barometer_read_low_near_the_ground(truth: Truth, vehicle: Vehicle) -> None:
    barometer = dataclasses.replace(errorless(vehicle).barometer, ground_effect_m=2.0)
    table = vehicle_air_data(truth, barometer, UNDULATION_M, (), SEED)
    error = table["baro_alt_meter"] - (488.0 - truth.at(table["timestamp_sample"], truth.position[:, 2]))
    after = table["timestamp_sample"] * 1e-6 - truth.events.takeoff_s
    assert np.allclose(error[after < -4.0], 0.0, atol=1e-3)
    assert error[np.abs(after) < 0.3].min() == pytest.approx(-2.0, abs=0.3)
    assert np.allclose(error[(after > 8.0) & (after < 15.0)], 0.0, atol=0.2)


def test_same_seed_same_samples_other_seed_others(truth: Truth, vehicle: Vehicle, mission: Mission) -> None:
    first, second, third = (vehicle_air_data(truth, vehicle.barometer, UNDULATION_M, (), seed) for seed in (1, 1, 2))
    assert np.array_equal(first["baro_alt_meter"], second["baro_alt_meter"])
    assert not np.array_equal(first["baro_alt_meter"][:50], third["baro_alt_meter"][:50])
