"""Inertial sensors: read at a high rate, integrated to the samples that the estimator gets (`sensor_combined`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from fusetune.execute.noise import gauss_markov, random_stream, random_walk, unit_vectors, white_noise
from fusetune.execute.sensors.faults import (
    AccelerometerBias,
    AliasedVibration,
    Clipping,
    Fault,
    GyroBias,
    ImuGaps,
    StrongVibration,
    of_kind,
)
from fusetune.execute.vehicle import Imu, InertialSensor
from fusetune.execute.world.truth import Truth
from fusetune.execute.world.vehicle_state import ACCELEROMETER_ID, GYRO_ID
from fusetune.px4.flight import TopicTable, select_rows, stacked

ROTORS = 4
ROTOR_SPEED_SPREAD = 0.015
"""Relative standard deviation of the rotors' speeds among each other."""
BLADE_TONE_SHARE = 0.5
"""Two blades shake at twice the rotor's frequency, with this share of the amplitude."""
CLIPPING_SHARE_OF_RANGE = 0.999
SHAKING_DIRECTION = np.array([0.35, -0.25, 0.9])
STATUS_INTERVAL_US = 100_000
METRIC_KEEPS = 0.99
"""Share of a vibration metric that stays from one integrated sample to the next."""
TEMPERATURE_C = 42.0


@dataclass(frozen=True)
class InertialTopics:
    """`sensor_combined` as the estimator gets it, and `vehicle_imu_status`."""

    samples: TopicTable
    status: TopicTable


def inertial_topics(truth: Truth, imu: Imu, faults: Sequence[Fault], seed: int) -> InertialTopics:
    """Both topics of the IMU, with samples lost that `ImuGaps` takes."""
    samples, clipped = _integrated(truth, imu, faults, seed)
    kept = ~_lost(truth, samples["timestamp"], faults, seed)
    return InertialTopics(select_rows(samples, kept), _imu_status(samples, clipped, imu))


def sensor_combined(truth: Truth, imu: Imu, faults: Sequence[Fault], seed: int) -> TopicTable:
    """Samples of `inertial_topics` before any is lost."""
    return _integrated(truth, imu, faults, seed)[0]


def _integrated(truth: Truth, imu: Imu, faults: Sequence[Fault], seed: int) -> tuple[TopicTable, dict[str, np.ndarray]]:
    """Integrated IMU samples in the layout of PX4's topic.

    Each raw sample is the mean of the true motion over its interval with scale, mounting and bias errors, noise and
    vibration, clipped at the sensor's range. Raw samples are summed over the interval of an output sample; the sum of
    rotations is completed by the coning term, as PX4's integrator does. With them the number of raw samples that were
    clipped in each, by axis, (N, 3).
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
    clipped = {
        "accel": accelerometer_clipped[:used].reshape(shape).sum(axis=1),
        "gyro": gyro_clipped[:used].reshape(shape).sum(axis=1),
    }
    table: TopicTable = {
        "timestamp": timestamp.astype(np.int64),
        **{f"gyro_rad[{axis}]": gyro[:, axis] for axis in range(3)},
        "gyro_integral_dt": interval_us,
        "accelerometer_timestamp_relative": np.zeros(samples, np.int32),
        **{f"accelerometer_m_s2[{axis}]": accelerometer[:, axis] for axis in range(3)},
        "accelerometer_integral_dt": interval_us.copy(),
        "accelerometer_clipping": _clipping_bits(clipped["accel"]),
        "gyro_clipping": _clipping_bits(clipped["gyro"]),
        "accel_calibration_count": ones,
        "gyro_calibration_count": ones.copy(),
    }
    return table, clipped


def _lost(truth: Truth, timestamp: np.ndarray, faults: Sequence[Fault], seed: int) -> np.ndarray:
    """Which samples are lost, in runs of random length, (N,) bool."""
    lost = np.zeros(len(timestamp), np.bool_)
    for fault in of_kind(faults, ImuGaps):
        rng = random_stream(seed, "imu gaps")
        on = fault.holds(timestamp * 1e-6 - truth.events.takeoff_s)
        begins = np.flatnonzero(on & (rng.random(len(on)) < 2.0 * fault.share / (fault.longest + 1.0)))
        for begin, length in zip(begins, rng.integers(1, fault.longest + 1, len(begins)), strict=True):
            lost[begin : begin + length] = True
    return lost


def _imu_status(samples: TopicTable, clipped: dict[str, np.ndarray], imu: Imu) -> TopicTable:
    """`vehicle_imu_status` ten times a second.

    PX4's metrics are first-order low-passes, over the integrated samples, of the length of the change of acceleration
    and of angular rate from one to the next, and of the cross product of successive rates (`VehicleIMU`).
    """
    gyro, accelerometer = (stacked(samples, name).astype(np.float64) for name in ("gyro_rad", "accelerometer_m_s2"))
    timestamp = samples["timestamp"]
    last = np.flatnonzero(np.diff(timestamp // STATUS_INTERVAL_US))
    status: TopicTable = {
        "timestamp": timestamp[last],
        "accel_device_id": np.full(len(last), ACCELEROMETER_ID, np.uint32),
        "gyro_device_id": np.full(len(last), GYRO_ID, np.uint32),
    }
    for sensor, counts in clipped.items():
        total = np.cumsum(counts, axis=0)[last].astype(np.uint32)
        status |= {f"{sensor}_clipping[{axis}]": np.ascontiguousarray(total[:, axis]) for axis in range(3)}
    status |= {f"{sensor}_error_count": np.zeros(len(last), np.uint32) for sensor in clipped}
    for name, value in (("rate_hz", imu.rate_hz), ("raw_rate_hz", imu.raw_rate_hz)):
        status |= {f"{sensor}_{name}": np.full(len(last), value, np.float32) for sensor in clipped}
    for name, change in (
        ("accel_vibration_metric", np.diff(accelerometer, axis=0)),
        ("gyro_vibration_metric", np.diff(gyro, axis=0)),
        ("delta_angle_coning_metric", np.cross(gyro[1:], gyro[:-1])),
    ):
        smooth = lfilter([1.0 - METRIC_KEEPS], [1.0, -METRIC_KEEPS], np.linalg.norm(change, axis=1))
        status[name] = np.asarray(smooth)[np.maximum(last - 1, 0)].astype(np.float32)
    length = np.diff(last, prepend=-1)[:, None]
    for sensor, readings in (("accel", accelerometer), ("gyro", gyro)):
        mean = np.diff(np.cumsum(readings, axis=0)[last], axis=0, prepend=0.0) / length
        status |= {f"mean_{sensor}[{axis}]": mean[:, axis].astype(np.float32) for axis in range(3)}
    return status | {f"temperature_{sensor}": np.full(len(last), TEMPERATURE_C, np.float32) for sensor in clipped}


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
    _add_offsets(acceleration, rate, truth, faults)
    return acceleration, rate


def _add_offsets(acceleration: np.ndarray, rate: np.ndarray, truth: Truth, faults: Sequence[Fault]) -> None:
    """What faults add to all readings, (N - 1, 3)."""
    for biased in of_kind(faults, AccelerometerBias):
        acceleration += np.array(biased.bias_m_s2)
    for aliased in of_kind(faults, AliasedVibration):
        offset = np.array(aliased.offset_m_s2)
        # A sensor's mean is off by a share of the power of what shakes it: the square of an amplitude that itself
        # grows with the square of the rotor speed.
        power = truth.rotor_speed[1:] ** 4
        beat = np.sin(2.0 * np.pi * aliased.beat_hz * truth.after_takeoff_s[1:]) * truth.rotor_speed[1:] ** 2
        along = offset / max(float(np.linalg.norm(offset)), 1e-9)
        acceleration += power[:, None] * offset + (aliased.beat_m_s2 * beat)[:, None] * along
    for warmed in of_kind(faults, GyroBias):
        since_s = truth.time_s[1:] - truth.time_s[0]
        share = 1.0 - np.exp(-since_s / warmed.warming_time_s)
        rate += np.array(warmed.turn_on_rad_s) + share[:, None] * np.array(warmed.warming_rad_s)


def _with_errors(true: np.ndarray, sensor: InertialSensor, step_s: float, seed: int, name: str) -> np.ndarray:
    rng = random_stream(seed, name)
    scale = np.diag(1.0 + sensor.scale_error * rng.standard_normal(3))
    mounting = Rotation.from_rotvec(np.radians(sensor.misalignment_deg) * rng.standard_normal(3)).as_matrix()
    bias = sensor.turn_on_bias * rng.standard_normal(3)
    drift = random_walk(rng, len(true), 3, step_s, sensor.bias_random_walk)
    noise = white_noise(rng, len(true), 3, step_s, sensor.noise_density)
    readings = np.asarray(true @ (scale @ mounting).T + bias + drift + noise)
    if sensor.bias_wander > 0.0:
        wander = random_stream(seed, f"{name} wander")
        readings += gauss_markov(wander, len(true), 3, step_s, sensor.bias_wander, sensor.bias_wander_time_s)
    return readings


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
    """Bit mask of the axes on which any raw sample was clipped, of counts (K, 3), (K,) uint8."""
    return np.asarray((clipped > 0) @ np.array([1, 2, 4])).astype(np.uint8)
