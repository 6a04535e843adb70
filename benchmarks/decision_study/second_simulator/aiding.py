"""Receiver, magnetometer and barometer."""

from __future__ import annotations

from datetime import date
from functools import cache

import numpy as np
from pygeomag import GeoMag

from fusetune.px4.flight import TopicTable

from .chance import Array, markov
from .settings import Barometer, Gnss, Magnetometer, Wander
from .truth import ALT_M, LAT_DEG, LON_DEG, UNDULATION_M, Truth, geodetic

DAY = date(2026, 3, 1)
VERTICAL_FACTOR = 1.5
WASH_HEIGHT_M = 1.2
FIX_3D = 3
MAGNETOMETER_LATENCY_S, BAROMETER_LATENCY_S = 0.002, 0.004
GNSS_ID, MAGNETOMETER_ID, BAROMETER_ID = 11_666_437, 659_225, 3_997_963


def _sampled(truth: Truth, rate_hz: float, rng: np.random.Generator) -> Array:
    """Times of samples from a phase of chance on, whole microseconds."""
    first = truth.time_s[0] + 0.3 + rng.uniform(0.0, 1.0 / rate_hz)
    return np.asarray(np.arange(first, truth.time_s[-1] - 0.3, 1.0 / rate_hz).round(6))


def _us(time_s: Array) -> np.ndarray:
    return np.rint(time_s * 1e6).astype(np.int64)


def _error(error: Wander, samples: int, step_s: float, rng: np.random.Generator) -> Array:
    white = rng.normal(0.0, error.white, (samples, 3))
    wander = markov(rng, samples, 3, step_s, error.markov, error.markov_time_s)
    return (white + wander) * np.array([1.0, 1.0, VERTICAL_FACTOR])


def vehicle_gps_position(truth: Truth, gnss: Gnss, rng: np.random.Generator) -> TopicTable:
    """The topic of the receiver; `timestamp` is that of receipt, later than the measurement by the true delay."""
    time = _sampled(truth, gnss.rate_hz, rng)
    samples, step_s = time.size, 1.0 / gnss.rate_hz
    at_antenna = truth.beside(np.array(gnss.antenna_m))
    position = truth.at(time, at_antenna.position) + _error(gnss.position, samples, step_s, rng)
    velocity = (truth.at(time, at_antenna.velocity) + _error(gnss.velocity, samples, step_s, rng)).astype(np.float32)
    lat, lon, alt = geodetic(position)

    def constant(value: float, kind: type = np.float32) -> np.ndarray:
        return np.full(samples, value, kind)

    return {
        "timestamp": _us(time + 1e-3 * gnss.delay_ms),
        "timestamp_sample": constant(0, np.int64),
        "latitude_deg": lat,
        "longitude_deg": lon,
        "altitude_msl_m": alt,
        "altitude_ellipsoid_m": alt + UNDULATION_M,
        "time_utc_usec": (_us(time) + 1_772_352_000_000_000).astype(np.uint64),
        "device_id": constant(GNSS_ID, np.uint32),
        "s_variance_m_s": constant(gnss.reported_velocity_m_s),
        "c_variance_rad": constant(0.08),
        "eph": constant(gnss.reported_position_m),
        "epv": constant(VERTICAL_FACTOR * gnss.reported_position_m),
        "hdop": constant(0.8),
        "vdop": constant(1.1),
        "noise_per_ms": constant(95, np.int32),
        "jamming_indicator": constant(9, np.int32),
        "vel_m_s": np.hypot(velocity[:, 0], velocity[:, 1]),
        "vel_n_m_s": velocity[:, 0],
        "vel_e_m_s": velocity[:, 1],
        "vel_d_m_s": velocity[:, 2],
        "cog_rad": np.arctan2(velocity[:, 1], velocity[:, 0]),
        "timestamp_time_relative": constant(0, np.int32),
        "heading": constant(np.nan),
        "heading_offset": constant(np.nan),
        "heading_accuracy": constant(np.nan),
        "automatic_gain_control": constant(2500, np.uint16),
        "fix_type": constant(FIX_3D, np.uint8),
        "jamming_state": constant(1, np.uint8),
        "spoofing_state": constant(1, np.uint8),
        "vel_ned_valid": constant(True, np.bool_),
        "satellites_used": constant(19, np.uint8),
    }


@cache
def _earth_field() -> Array:
    """World Magnetic Model at home, (3,) NED, Gauss."""
    field = GeoMag(coefficients_file="wmm/WMM_2025.COF").calculate(
        LAT_DEG, LON_DEG, (ALT_M + UNDULATION_M) * 1e-3, DAY.year + (DAY.timetuple().tm_yday - 1) / 365.0
    )
    return np.array([field.x, field.y, field.z]) * 1e-5


def vehicle_magnetometer(truth: Truth, sensor: Magnetometer, rng: np.random.Generator) -> TopicTable:
    """The topic of the magnetometer: the earth's field through soft and hard iron."""
    time = _sampled(truth, sensor.rate_hz, rng)
    soft = np.eye(3) + rng.normal(0.0, sensor.soft_iron_spread, (3, 3))
    hard = rng.normal(0.0, sensor.hard_iron_spread_gauss, 3)
    field = truth.attitude_at(time).inv().apply(_earth_field()) @ soft.T + hard
    seen = (field + rng.normal(0.0, sensor.noise_gauss, field.shape)).astype(np.float32)
    return {
        "timestamp": _us(time + MAGNETOMETER_LATENCY_S),
        "timestamp_sample": _us(time),
        "device_id": np.full(time.size, MAGNETOMETER_ID, np.uint32),
        **{f"magnetometer_ga[{axis}]": seen[:, axis] for axis in range(3)},
        "calibration_count": np.ones(time.size, np.uint8),
    }


def vehicle_air_data(truth: Truth, sensor: Barometer, rng: np.random.Generator) -> TopicTable:
    """The topic of the barometer: wandering, fooled by the wash at the ground and by the airspeed."""
    time = _sampled(truth, sensor.rate_hz, rng)
    height = -truth.at(time, truth.position[:, 2])
    wash = sensor.wash_m * truth.at(time, truth.path.lift) * np.exp(-np.maximum(height, 0.0) / WASH_HEIGHT_M)
    wander = markov(rng, time.size, 1, 1.0 / sensor.rate_hz, sensor.wander_m, sensor.wander_time_s)[:, 0]
    error = rng.normal(0.0, 4.0) + wander - wash + sensor.airspeed_error * truth.at(time, truth.airspeed) ** 2
    altitude = ALT_M + height + error + rng.normal(0.0, sensor.noise_m, time.size)
    # International standard atmosphere (ISO 2533).
    kelvin = 288.15 - 0.0065 * altitude
    pressure = 101_325.0 * (kelvin / 288.15) ** 5.25588
    return {
        "timestamp": _us(time + BAROMETER_LATENCY_S),
        "timestamp_sample": _us(time),
        "baro_device_id": np.full(time.size, BAROMETER_ID, np.uint32),
        "baro_alt_meter": altitude.astype(np.float32),
        "baro_pressure_pa": pressure.astype(np.float32),
        "ambient_temperature": (kelvin - 273.15).astype(np.float32),
        "rho": (pressure / (287.053 * kelvin)).astype(np.float32),
        "temperature_source": np.zeros(time.size, np.uint8),
        "calibration_count": np.ones(time.size, np.uint8),
    }
