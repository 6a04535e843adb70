"""Barometer (`vehicle_air_data`): pressure altitude that drifts and is fooled by the rotors' wash near the ground."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusetune.execute.noise import gauss_markov, random_stream
from fusetune.execute.sensors.faults import (
    BarometerDrift,
    Fault,
    GroundEffect,
    PropellerWash,
    StaticPressure,
    of_kind,
)
from fusetune.execute.sensors.sampling import sample_times
from fusetune.execute.vehicle import Barometer
from fusetune.execute.world.truth import STANDARD_GRAVITY_M_S2, Truth
from fusetune.px4.flight import TopicTable

DEVICE_ID = 4028193
SEA_LEVEL_PRESSURE_PA = 101_325.0
SEA_LEVEL_TEMPERATURE_K = 288.15
LAPSE_RATE_K_M = 0.0065
PRESSURE_EXPONENT = 5.2558797
GAS_CONSTANT_AIR_J_KG_K = 287.05287
ZERO_CELSIUS_K = 273.15


def vehicle_air_data(
    truth: Truth, barometer: Barometer, geoid_undulation_m: float, faults: Sequence[Fault], seed: int
) -> TopicTable:
    """Barometer samples in the layout of PX4's topic."""
    rng = random_stream(seed, "barometer")
    sampled_us = sample_times(truth, barometer.rate_hz, rng)
    _, _, height = truth.frame.to_geodetic(truth.at(sampled_us, truth.position))
    altitude = height - geoid_undulation_m + _errors(truth, barometer, faults, sampled_us, rng)
    temperature, pressure, density = standard_atmosphere(altitude)
    samples = len(sampled_us)
    return {
        "timestamp": (sampled_us + round(barometer.latency_ms * 1e3)).astype(np.int64),
        "timestamp_sample": sampled_us.astype(np.int64),
        "baro_device_id": np.full(samples, DEVICE_ID, np.uint32),
        "baro_alt_meter": altitude.astype(np.float32),
        "baro_pressure_pa": pressure.astype(np.float32),
        "ambient_temperature": (temperature - ZERO_CELSIUS_K).astype(np.float32),
        "rho": density.astype(np.float32),
        "temperature_source": np.zeros(samples, np.uint8),
        "calibration_count": np.ones(samples, np.uint8),
    }


def standard_atmosphere(altitude_m: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Temperature (K), pressure (Pa) and density (kg/m³) in the troposphere of the ISO 2533 atmosphere."""
    temperature = SEA_LEVEL_TEMPERATURE_K - LAPSE_RATE_K_M * altitude_m
    pressure = SEA_LEVEL_PRESSURE_PA * (temperature / SEA_LEVEL_TEMPERATURE_K) ** PRESSURE_EXPONENT
    return temperature, pressure, pressure / (GAS_CONSTANT_AIR_J_KG_K * temperature)


def ground_effect_depth_m(barometer: Barometer, faults: Sequence[Fault]) -> float:
    """How much lower the barometer reads on the ground at hover throttle."""
    return barometer.ground_effect_m + sum(fault.depth_m for fault in of_kind(faults, GroundEffect))


def _errors(
    truth: Truth, barometer: Barometer, faults: Sequence[Fault], sampled_us: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Error of the altitude, (N,) m: constant, steady drift, wander, noise, ground effect and what faults add."""
    samples = len(sampled_us)
    offset, rate = barometer.offset_m * rng.standard_normal(), barometer.drift_rate_m_s * rng.standard_normal()
    wander = gauss_markov(rng, samples, 1, 1.0 / barometer.rate_hz, barometer.drift_m, barometer.drift_time_s)[:, 0]
    noise = barometer.noise_m * rng.standard_normal(samples)
    above_ground = np.maximum(-truth.at(sampled_us, truth.position[:, 2]), 0.0)
    thrust = truth.at(sampled_us, truth.rotor_speed) ** 2
    depth = ground_effect_depth_m(barometer, faults)
    wash = depth * thrust * np.exp(-above_ground / barometer.ground_effect_height_m)
    drift = rate * (sampled_us - truth.timestamp_us[0]) * 1e-6
    for blown in of_kind(faults, PropellerWash):
        drift = drift + blown.height_m * thrust
    for warmed in of_kind(faults, BarometerDrift):
        since_s = sampled_us * 1e-6 - truth.events.takeoff_s - warmed.start_s
        drift = drift + warmed.height_m * np.clip(since_s / warmed.duration_s, 0.0, 1.0)
    for fault in of_kind(faults, StaticPressure):
        drift = drift - _pressure_height(truth, fault, sampled_us)
    return np.asarray(offset + drift + wander + noise - wash)


def _pressure_height(truth: Truth, fault: StaticPressure, sampled_us: np.ndarray) -> np.ndarray:
    """Height (m) of a column of air that weighs the pressure error Σ Kᵢ ½ ρ vᵢ²; its density cancels, (N,)."""
    through_air = truth.at(sampled_us, truth.velocity - truth.wind)
    x, y, z = truth.attitude_at(sampled_us).inv().apply(through_air).T
    share_x = np.where(x >= 0.0, fault.forward, fault.backward)
    share_y = np.where(y >= 0.0, fault.right, fault.left)
    return np.asarray((share_x * x**2 + share_y * y**2 + fault.vertical * z**2) / (2.0 * STANDARD_GRAVITY_M_S2))
