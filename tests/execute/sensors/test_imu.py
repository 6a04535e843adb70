"""The inertial sensors feel what physics says, and their errors are those configured."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.execute.strapdown import Navigation

from fusetune.execute.sensors.faults import Clipping, StrongVibration
from fusetune.execute.sensors.imu import coning_integral, sensor_combined
from fusetune.execute.vehicle import Vehicle
from fusetune.execute.world.truth import Truth
from fusetune.px4.flight import TopicTable, stacked

SEED = 7


@pytest.fixture(scope="module")
def ideal_samples(truth: Truth, ideal_imu_vehicle: Vehicle) -> TopicTable:
    return sensor_combined(truth, ideal_imu_vehicle.imu, (), SEED)


def local_state(truth: Truth, index: int) -> tuple[float, float, float, np.ndarray, Rotation]:
    """Latitude, longitude, height, velocity and attitude in the local north-east-down axes."""
    lat, lon, height = truth.frame.to_geodetic(truth.position[index])
    axes = truth.frame.local_axes(lat, lon)
    return (
        float(lat),
        float(lon),
        float(height),
        axes.T @ truth.velocity[index],
        (Rotation.from_matrix(axes.T) * truth.attitude[index]),
    )


def test_strapdown_navigation_with_ideal_samples_returns_to_the_truth(truth: Truth, ideal_samples: TopicTable) -> None:
    lat, lon, height, velocity, attitude = local_state(truth, 0)
    navigation = Navigation(lat, lon, height, tuple(velocity), tuple(attitude.as_quat(scalar_first=True)))
    interval_s = ideal_samples["gyro_integral_dt"] * 1e-6
    angles = (stacked(ideal_samples, "gyro_rad") * interval_s[:, None]).tolist()
    velocities = (stacked(ideal_samples, "accelerometer_m_s2") * interval_s[:, None]).tolist()
    for angle, change, dt in zip(angles, velocities, interval_s.tolist(), strict=True):
        navigation.step(tuple(angle), tuple(change), dt)
    last = int(np.searchsorted(truth.timestamp_us, ideal_samples["timestamp"][-1]))
    lat, lon, height, velocity, attitude = local_state(truth, last)
    # Over a minute single precision of the logged samples alone (5e-7 m/s² at 9.8) makes up to a millimetre
    assert (navigation.lat - lat) * 6.37e6 == pytest.approx(0.0, abs=0.01)
    assert (navigation.lon - lon) * 6.37e6 * math.cos(lat) == pytest.approx(0.0, abs=0.01)
    assert navigation.height == pytest.approx(height, abs=0.01)
    assert np.allclose(navigation.velocity, velocity, atol=1e-3)
    error = Rotation.from_quat(navigation.quaternion, scalar_first=True).inv() * attitude
    assert np.degrees(error.magnitude()) < 1e-3


def test_without_the_earth_rate_the_heading_would_be_lost(truth: Truth, ideal_samples: TopicTable) -> None:
    # On the ground the gyro feels the earth alone: 15.04°/h about the axis of the earth
    on_ground = ideal_samples["timestamp"] < (truth.events.takeoff_s - 0.5) * 1e6
    rate = stacked(ideal_samples, "gyro_rad")[on_ground]
    assert np.degrees(np.linalg.norm(rate, axis=1)) * 3600.0 == pytest.approx(15.041, abs=0.01)


def test_specific_force_on_the_ground_is_local_gravity(truth: Truth, ideal_samples: TopicTable) -> None:
    # Normal gravity at 47.397742° and 535.4 m by the formula of the International Gravity Formula 1980 with the
    # free-air gradient: 9.780327 (1 + 0.0053024 sin² φ - 0.0000058 sin² 2φ) - 3.086e-6 h
    lat = math.radians(47.397742)
    gravity = 9.780327 * (1.0 + 0.0053024 * math.sin(lat) ** 2 - 0.0000058 * math.sin(2 * lat) ** 2) - 3.086e-6 * 535.4
    on_ground = ideal_samples["timestamp"] < (truth.events.takeoff_s - 0.5) * 1e6
    force = stacked(ideal_samples, "accelerometer_m_s2")[on_ground]
    assert np.linalg.norm(force, axis=1) == pytest.approx(gravity, abs=2e-5)


def test_coning_motion_is_integrated_to_the_true_rotation() -> None:
    # Classical coning: the body z axis moves on a cone of half angle a, the rotation from start to end is known exactly
    angle, frequency, step_s = math.radians(2.0), 2.0 * math.pi * 20.0, 1e-3
    time_s = np.arange(5) * step_s

    def attitude(t: np.ndarray) -> Rotation:
        axis = np.stack([np.cos(frequency * t), np.sin(frequency * t), np.zeros_like(t)], axis=-1)
        return Rotation.from_rotvec(angle * axis)

    raw = (attitude(time_s[:-1]).inv() * attitude(time_s[1:])).as_rotvec()
    exact = (attitude(time_s[:1]).inv() * attitude(time_s[-1:])).as_rotvec()[0]
    plain_error = np.linalg.norm(raw.sum(axis=0) - exact)
    coned_error = np.linalg.norm(coning_integral(raw[None])[0] - exact)
    assert coned_error < 0.02 * plain_error


def test_noise_of_a_resting_sensor_has_the_configured_density_and_bias(truth: Truth, vehicle: Vehicle) -> None:
    samples = sensor_combined(truth, vehicle.imu, (), SEED)
    still = samples["timestamp"] < (truth.events.armed_s - 0.1) * 1e6
    for name, sensor in (("accelerometer_m_s2", vehicle.imu.accelerometer), ("gyro_rad", vehicle.imu.gyro)):
        values = stacked(samples, name)[still]
        expected = sensor.noise_density * math.sqrt(vehicle.imu.rate_hz)
        count = 3 * len(values)
        # Standard error of a standard deviation is σ/√(2n); five of them
        assert values.std(axis=0).mean() == pytest.approx(expected, rel=5.0 / math.sqrt(2.0 * count) + 0.01)
    assert np.all(np.abs(stacked(samples, "gyro_rad")[still].mean(axis=0)) < 5.0 * vehicle.imu.gyro.turn_on_bias)


def test_vibration_comes_with_the_rotors_and_grows_with_the_fault(truth: Truth, vehicle: Vehicle) -> None:
    plain = sensor_combined(truth, vehicle.imu, (), SEED)
    strong = sensor_combined(truth, vehicle.imu, (StrongVibration(2.0, 3.0, 4.0),), SEED)
    after = plain["timestamp"] * 1e-6 - truth.events.takeoff_s
    roughness = np.diff(plain["accelerometer_m_s2[2]"])
    assert roughness[(after[1:] > 3) & (after[1:] < 10)].std() > 5.0 * roughness[after[1:] < -4].std()
    during = (after >= 2.01) & (after < 4.99)
    outside = ~((after >= 1.99) & (after < 5.01))
    assert np.array_equal(plain["gyro_rad[0]"][outside], strong["gyro_rad[0]"][outside])
    ratio = (
        np.diff(strong["accelerometer_m_s2[2]"][during]).std() / np.diff(plain["accelerometer_m_s2[2]"][during]).std()
    )
    assert ratio == pytest.approx(4.0, rel=0.1)


def test_clipping_limits_readings_and_sets_the_bits_of_the_axes(truth: Truth, vehicle: Vehicle) -> None:
    samples = sensor_combined(truth, vehicle.imu, (Clipping(2.0, 1.0),), SEED)
    after = samples["timestamp"] * 1e-6 - truth.events.takeoff_s
    during = (after > 2.01) & (after < 2.99)
    assert np.abs(stacked(samples, "accelerometer_m_s2")).max() <= np.float32(vehicle.imu.accelerometer.range)
    # The shaking is 196 m/s² on z and 76 m/s² on x: only z exceeds 156.9 m/s²
    assert set(np.unique(samples["accelerometer_clipping"][during])) == {0, 4}
    assert not samples["accelerometer_clipping"][~((after > 1.98) & (after < 3.02))].any()


def test_scale_error_stretches_gravity(truth: Truth, ideal_imu_vehicle: Vehicle) -> None:
    imu = ideal_imu_vehicle.imu
    stretched = dataclasses.replace(imu, accelerometer=dataclasses.replace(imu.accelerometer, scale_error=0.01))
    plain, samples = sensor_combined(truth, imu, (), SEED), sensor_combined(truth, stretched, (), SEED)
    ratio = samples["accelerometer_m_s2[2]"] / plain["accelerometer_m_s2[2]"]
    assert ratio == pytest.approx(float(ratio[0]), abs=1e-5)
    assert 0.0 < abs(float(ratio[0]) - 1.0) < 0.05
