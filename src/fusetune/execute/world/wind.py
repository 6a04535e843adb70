"""Wind at the vehicle: a steady mean and Dryden turbulence."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import bilinear, lfilter

from fusetune.execute.noise import gauss_markov, random_stream
from fusetune.execute.vehicle import Environment

FEET_PER_M = 1.0 / 0.3048
TURBULENCE_RATE_HZ = 100.0
LOWEST_HEIGHT_M = 3.0
HIGHEST_HEIGHT_M = 300.0
"""The low-altitude turbulence model holds up to 1000 feet."""


@dataclass(frozen=True)
class TurbulenceScales:
    """Standard deviations (m/s) and time constants (s) of longitudinal, lateral and vertical gusts."""

    deviation: tuple[float, float, float]
    time_constant_s: tuple[float, float, float]


def turbulence_scales(height_m: float, wind_at_6m_m_s: float, airspeed_m_s: float) -> TurbulenceScales:
    """Scales of the low-altitude Dryden model (MIL-F-8785C, section 3.7.3.4)."""
    height_ft = min(max(height_m, LOWEST_HEIGHT_M), HIGHEST_HEIGHT_M) * FEET_PER_M
    base = 0.177 + 0.000823 * height_ft
    vertical_deviation = 0.1 * wind_at_6m_m_s
    horizontal_deviation = vertical_deviation / base**0.4
    horizontal_length_m = height_ft / base**1.2 / FEET_PER_M
    vertical_length_m = height_ft / FEET_PER_M
    return TurbulenceScales(
        (horizontal_deviation, horizontal_deviation, vertical_deviation),
        (horizontal_length_m / airspeed_m_s, horizontal_length_m / airspeed_m_s, vertical_length_m / airspeed_m_s),
    )


def mean_wind(environment: Environment) -> np.ndarray:
    """Mean wind, north, east, down, (3,) m/s (the direction it blows to)."""
    direction = math.radians(environment.wind_from_deg) + math.pi
    return environment.wind_speed_m_s * np.array([math.cos(direction), math.sin(direction), 0.0])


def gusts(environment: Environment, time_s: np.ndarray, height_m: float, cruise_m_s: float, seed: int) -> np.ndarray:
    """Turbulent wind at ascending times, north, east, down, (N, 3) m/s.

    The longitudinal axis lies along the mean wind. The vehicle's speed through the air is taken as constant.
    """
    airspeed = max(math.hypot(environment.wind_speed_m_s, cruise_m_s), 2.0)
    scales = turbulence_scales(height_m, environment.turbulence_wind_m_s, airspeed)
    step_s = 1.0 / TURBULENCE_RATE_HZ
    settling_s = 6.0 * max(scales.time_constant_s)
    samples = math.ceil((time_s[-1] - time_s[0]) / step_s) + 2
    rng = random_stream(seed, "turbulence")
    warm_up = int(settling_s / step_s)
    along = gauss_markov(rng, samples, 1, step_s, scales.deviation[0], scales.time_constant_s[0])[:, 0]
    across, down = (
        _transverse(rng, samples + warm_up, step_s, scales.deviation[axis], scales.time_constant_s[axis])[warm_up:]
        for axis in (1, 2)
    )
    direction = math.radians(environment.wind_from_deg) + math.pi
    north = math.cos(direction) * along - math.sin(direction) * across
    east = math.sin(direction) * along + math.cos(direction) * across
    grid_s = time_s[0] + step_s * np.arange(samples)
    return np.stack([np.interp(time_s, grid_s, axis) for axis in (north, east, down)], axis=-1)


def _transverse(
    rng: np.random.Generator, samples: int, step_s: float, deviation: float, time_constant_s: float
) -> np.ndarray:
    """Gust across the flight: white noise through (1 + √3 τ s) / (1 + τ s)².

    The squared impulse response of that form integrates to 1/τ, so noise of intensity σ²τ gives a variance of σ².
    """
    tau = time_constant_s
    numerator, denominator = bilinear([math.sqrt(3.0) * tau, 1.0], [tau**2, 2.0 * tau, 1.0], 1.0 / step_s)
    noise = rng.standard_normal(samples) * (deviation * math.sqrt(tau / step_s))
    return np.asarray(lfilter(numerator, denominator, noise))
