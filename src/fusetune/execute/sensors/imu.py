"""Inertial sensors: read at a high rate, integrated to the samples that the estimator gets (`sensor_combined`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from fusetune.execute.noise import random_stream, random_walk, unit_vectors, white_noise
from fusetune.execute.sensors.faults import Clipping, Fault, StrongVibration, of_kind
from fusetune.execute.vehicle import Imu, InertialSensor
from fusetune.execute.world.truth import Truth
from fusetune.px4.flight import TopicTable

ROTORS = 4
ROTOR_SPEED_SPREAD = 0.015
"""Relative standard deviation of the rotors' speeds among each other."""
BLADE_TONE_SHARE = 0.5
"""Two blades shake at twice the rotor's frequency, with this share of the amplitude."""
CLIPPING_SHARE_OF_RANGE = 0.999
SHAKING_DIRECTION = np.array([0.35, -0.25, 0.9])


def sensor_combined(truth: Truth, imu: Imu, faults: Sequence[Fault], seed: int) -> TopicTable:
    """Integrated IMU samples in the layout of PX4's topic.

    Each raw sample is the mean of the true motion over its interval with scale, mounting and bias errors, noise and
    vibration, clipped at the sensor's range. Raw samples are summed over the interval of an output sample; the sum of
    rotations is completed by the coning term, as PX4's integrator does.
    """
    raw_per_sample = imu.raw_rate_hz // imu.rate_hz
    step_s = truth.step_s
    acceleration, rate = _raw_samples(truth, imu, faults, seed)
    acceleration, accelerometer_clipped = _clipped(acceleration, imu.accelerometer.range)
    rate, gyro_clipped = _clipped(rate, imu.gyro.range)

    samples = len(acceleration) // raw_per_sample
    shape = (samples, raw_per_sample, 3)
    used = samples * raw_per_sample
    delta_velocity = acceleration[:used].reshape(shape).sum(axis=1) * step_s
    delta_angle = coning_integral(rate[:used].reshape(shape) * step_s)
    interval_s = raw_per_sample * step_s
    timestamp = truth.timestamp_us[raw_per_sample::raw_per_sample][:samples]
    accelerometer = (delta_velocity / interval_s).astype(np.float32)
    gyro = (delta_angle / interval_s).astype(np.float32)
    interval_us = np.full(samples, round(interval_s * 1e6), np.uint32)
    ones = np.ones(samples, np.uint8)
    return {
        "timestamp": timestamp.astype(np.int64),
        **{f"gyro_rad[{axis}]": gyro[:, axis] for axis in range(3)},
        "gyro_integral_dt": interval_us,
        "accelerometer_timestamp_relative": np.zeros(samples, np.int32),
        **{f"accelerometer_m_s2[{axis}]": accelerometer[:, axis] for axis in range(3)},
        "accelerometer_integral_dt": interval_us.copy(),
        "accelerometer_clipping": _clipping_bits(accelerometer_clipped[:used].reshape(shape)),
        "gyro_clipping": _clipping_bits(gyro_clipped[:used].reshape(shape)),
        "accel_calibration_count": ones,
        "gyro_calibration_count": ones.copy(),
    }


def coning_integral(raw_angles: np.ndarray) -> np.ndarray:
    """Rotation vector over M successive small rotations, (K, M, 3) → (K, 3) rad.

    Sum of the rotations and the second-order term ½ Σ αᵢ × βᵢ, where αᵢ is the sum before the i-th rotation βᵢ
    (Bortz, "A new mathematical formulation for strapdown inertial navigation", 1971).
    """
    before = np.cumsum(raw_angles, axis=1) - raw_angles
    return np.asarray(raw_angles.sum(axis=1) + 0.5 * np.cross(before, raw_angles).sum(axis=1))


def _raw_samples(truth: Truth, imu: Imu, faults: Sequence[Fault], seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Accelerometer (m/s²) and gyro (rad/s) readings at the raw rate, each (N - 1, 3), before clipping."""
    step_s = truth.step_s
    force = 0.5 * (truth.specific_force[:-1] + truth.specific_force[1:])
    acceleration = _with_errors(force, imu.accelerometer, step_s, seed, "accelerometer")
    rate = _with_errors(truth.rotation_increments / step_s, imu.gyro, step_s, seed, "gyro")
    strength = truth.rotor_speed[1:] ** 2 * _vibration_factor(truth.after_takeoff_s[1:], faults)
    phases = _rotor_phases(truth, imu, seed)
    vibration = imu.vibration
    for readings, tone, density, name in (
        (acceleration, vibration.accelerometer_tone, vibration.accelerometer_density, "accelerometer vibration"),
        (rate, vibration.gyro_tone, vibration.gyro_density, "gyro vibration"),
    ):
        rng = random_stream(seed, name)
        shaking = white_noise(rng, len(readings), 3, step_s, density) + tone * _tones(phases, rng)
        readings += shaking * strength[:, None]
    for fault in of_kind(faults, Clipping):
        time_s = truth.after_takeoff_s[1:]
        shake = fault.amplitude_m_s2 * np.sin(2.0 * np.pi * fault.frequency_hz * time_s) * fault.holds(time_s)
        acceleration += shake[:, None] * SHAKING_DIRECTION / np.linalg.norm(SHAKING_DIRECTION)
    return acceleration, rate


def _with_errors(true: np.ndarray, sensor: InertialSensor, step_s: float, seed: int, name: str) -> np.ndarray:
    rng = random_stream(seed, name)
    scale = np.diag(1.0 + sensor.scale_error * rng.standard_normal(3))
    mounting = Rotation.from_rotvec(np.radians(sensor.misalignment_deg) * rng.standard_normal(3)).as_matrix()
    bias = sensor.turn_on_bias * rng.standard_normal(3)
    drift = random_walk(rng, len(true), 3, step_s, sensor.bias_random_walk)
    noise = white_noise(rng, len(true), 3, step_s, sensor.noise_density)
    return np.asarray(true @ (scale @ mounting).T + bias + drift + noise)


def _vibration_factor(after_takeoff_s: np.ndarray, faults: Sequence[Fault]) -> np.ndarray:
    factor = np.ones_like(after_takeoff_s)
    for fault in of_kind(faults, StrongVibration):
        factor[fault.holds(after_takeoff_s)] *= fault.factor
    return factor


def _rotor_phases(truth: Truth, imu: Imu, seed: int) -> np.ndarray:
    """Angle of each rotor, (N - 1, ROTORS) rad."""
    rng = random_stream(seed, "rotors")
    spread = 1.0 + ROTOR_SPEED_SPREAD * rng.standard_normal(ROTORS)
    start = rng.uniform(0.0, 2.0 * np.pi, ROTORS)
    turned = 2.0 * np.pi * imu.vibration.rotor_frequency_hz * truth.step_s * np.cumsum(truth.rotor_speed[1:])
    return np.asarray(turned[:, None] * spread + start)


def _tones(phases: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Shaking of all rotors at unit amplitude, (N, 3)."""
    wave = np.sin(phases) + BLADE_TONE_SHARE * np.sin(2.0 * phases)
    return np.asarray(wave @ unit_vectors(rng, phases.shape[1]))


def _clipped(readings: np.ndarray, limit: float) -> tuple[np.ndarray, np.ndarray]:
    return np.clip(readings, -limit, limit), np.abs(readings) >= CLIPPING_SHARE_OF_RANGE * limit


def _clipping_bits(clipped: np.ndarray) -> np.ndarray:
    """Bit mask of the axes on which any raw sample of (K, M, 3) was clipped, (K,) uint8."""
    return np.asarray(clipped.any(axis=1) @ np.array([1, 2, 4])).astype(np.uint8)
