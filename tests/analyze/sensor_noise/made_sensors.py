"""Flights made for the sensors alone: what each sensor gives is said by the test."""

from __future__ import annotations

import numpy as np

from fusetune.px4.flight import Flight, ParameterHistory, TopicKey, TopicTable
from fusetune.px4.layouts.release_layouts import canonical

START_US = 2_000_000
TAKE_OFF_S, LANDING_S, END_S = 20.0, 80.0, 95.0
GYRO, ACCEL, MAG, BARO = 0.002, 0.03, 0.004, 0.1
"""Standard deviation of a sample at rest."""


def seconds(rate_hz: float) -> np.ndarray:
    return np.arange(0.0, END_S, 1.0 / rate_hz)


def times(at_s: np.ndarray) -> np.ndarray:
    return START_US + np.round(at_s * 1e6).astype(np.int64)


def imu_table(rng: np.random.Generator, rate_hz: float = 200.0, in_flight: float = 5.0) -> TopicTable:
    """White noise, in flight `in_flight` times as large; gravity along z."""
    at = seconds(rate_hz)
    flying = (at >= TAKE_OFF_S) & (at < LANDING_S)
    size = np.where(flying, in_flight, 1.0)[:, None]
    gyro = GYRO * size * rng.standard_normal((len(at), 3))
    accel = ACCEL * size * rng.standard_normal((len(at), 3)) + [0.0, 0.0, -9.81]
    interval = np.full(len(at), round(1e6 / rate_hz), np.uint32)
    table: TopicTable = {"timestamp": times(at)}
    table |= {f"gyro_rad[{i}]": gyro[:, i].astype(np.float32) for i in range(3)}
    table |= {f"accelerometer_m_s2[{i}]": accel[:, i].astype(np.float32) for i in range(3)}
    return table | {"gyro_integral_dt": interval, "accelerometer_integral_dt": interval}


def made_topics(rng: np.random.Generator, in_flight: float = 5.0) -> dict[TopicKey, TopicTable]:
    """20 s on the ground, disarmed for the first 18; a minute in the air; disarmed again 2 s after landing."""
    mag_at, baro_at = seconds(50.0), seconds(20.0)
    mag = MAG * rng.standard_normal((len(mag_at), 3)) + [0.2, 0.0, 0.4]
    return {
        ("sensor_combined", 0): imu_table(rng, in_flight=in_flight),
        ("vehicle_magnetometer", 0): {
            "timestamp": times(mag_at),
            "timestamp_sample": times(mag_at),
            "device_id": np.full(len(mag_at), 77, np.uint32),
            **{f"magnetometer_ga[{i}]": mag[:, i].astype(np.float32) for i in range(3)},
        },
        ("vehicle_air_data", 0): {
            "timestamp": times(baro_at),
            "timestamp_sample": times(baro_at),
            "baro_alt_meter": (100.0 + BARO * rng.standard_normal(len(baro_at))).astype(np.float32),
            "baro_pressure_pa": np.full(len(baro_at), 1e5, np.float32),
        },
        ("vehicle_land_detected", 0): {
            "timestamp": times(np.array([0.0, TAKE_OFF_S, LANDING_S])),
            "landed": np.array([1, 0, 1], np.uint8),
        },
        ("vehicle_status", 0): {
            "timestamp": times(np.array([0.0, TAKE_OFF_S - 2.0, LANDING_S + 2.0])),
            "arming_state": np.array([1, 2, 1], np.uint8),
        },
        ("sensor_selection", 0): {
            "timestamp": times(np.array([0.0])),
            "gyro_device_id": np.array([11], np.uint32),
            "accel_device_id": np.array([12], np.uint32),
        },
    }


def made_flight(topics: dict[TopicKey, TopicTable], name: str = "made") -> Flight:
    """The canonical flight of some topics."""
    return canonical(
        Flight(
            name=name,
            topics=topics,
            parameters=ParameterHistory(initial={"EKF2_GYR_NOISE": 0.015, "EKF2_ACC_NOISE": 0.35}),
            info={"ver_sw_release": 0x011000FF},
            start_timestamp=START_US,
            last_timestamp=START_US + round(END_S * 1e6),
        )
    )


AIRBORNE = ((START_US + round(TAKE_OFF_S * 1e6), START_US + round(LANDING_S * 1e6)),)
