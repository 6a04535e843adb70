"""Integrated IMU samples: exact increments of the truth, seen through misaligned and warming sensors."""

from __future__ import annotations

import numpy as np
from scipy.integrate import cumulative_trapezoid

from fusetune.px4.flight import TopicTable

from .chance import Array, resonance
from .settings import Imu, Inertial
from .truth import EARTH_RATE, STEP_S, Truth

DEVICE_ID = 2_621_450


def sensor_combined(truth: Truth, imu: Imu, chance: dict[str, np.random.Generator]) -> TopicTable:
    """The topic `sensor_combined`; a sample is stamped with the end of its interval."""
    every = round(1.0 / (imu.rate_hz * STEP_S))
    interval_s = every * STEP_S
    ends = np.arange(0, truth.time_s.size, every)
    attitude = truth.attitude[ends]
    turned = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / interval_s
    rate = turned + attitude[1:].inv().apply(EARTH_RATE)
    pushed = cumulative_trapezoid(truth.specific_force, dx=STEP_S, axis=0, initial=0)[ends]
    force = np.diff(pushed, axis=0) / interval_s
    time = truth.time_s[ends[1:]]
    lift = truth.path.lift[ends[1:]]
    seen = {
        name: _seen(true, sensor, imu, time, lift, chance[name]).astype(np.float32)
        for name, true, sensor in (("accelerometer", force, imu.accelerometer), ("gyro", rate, imu.gyro))
    }
    samples = time.size
    interval_us = np.full(samples, round(interval_s * 1e6), np.uint32)
    return {
        "timestamp": np.rint(time * 1e6).astype(np.int64),
        **{f"gyro_rad[{axis}]": seen["gyro"][:, axis] for axis in range(3)},
        "gyro_integral_dt": interval_us,
        "accelerometer_timestamp_relative": np.zeros(samples, np.int32),
        **{f"accelerometer_m_s2[{axis}]": seen["accelerometer"][:, axis] for axis in range(3)},
        "accelerometer_integral_dt": interval_us.copy(),
        "accelerometer_clipping": np.zeros(samples, np.uint8),
        "gyro_clipping": np.zeros(samples, np.uint8),
        "accel_calibration_count": np.ones(samples, np.uint8),
        "gyro_calibration_count": np.ones(samples, np.uint8),
    }


def _seen(true: Array, sensor: Inertial, imu: Imu, time: Array, lift: Array, rng: np.random.Generator) -> Array:
    """Readings (M, 3): scale and axes wrong, a bias that warming changes, white noise, and vibration in flight."""
    axes = np.eye(3) + np.diag(rng.normal(0.0, sensor.scale_spread, 3))
    axes += np.radians(rng.normal(0.0, sensor.misalignment_spread_deg, (3, 3))) * (1.0 - np.eye(3))
    warmed = 1.0 - np.exp(-time / imu.warming_time_s)
    bias = rng.normal(0.0, sensor.bias_spread, 3) + warmed[:, None] * rng.normal(0.0, sensor.warming_spread, 3)
    noise = rng.normal(0.0, sensor.density * np.sqrt(imu.rate_hz), true.shape)
    shaking = resonance(rng, time.size, 3, 1.0 / imu.rate_hz, imu.resonance_hz, imu.damping)
    return np.asarray(true @ axes.T + bias + noise + sensor.vibration * lift[:, None] * shaking)
