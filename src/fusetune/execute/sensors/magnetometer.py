"""Magnetometer (`vehicle_magnetometer`): the earth's field at home seen from the body, with its disturbances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusetune.execute.noise import random_stream, unit_vectors
from fusetune.execute.sensors.faults import Fault, MagneticDisturbance, of_kind
from fusetune.execute.sensors.sampling import sample_times
from fusetune.execute.vehicle import Environment, Magnetometer
from fusetune.execute.world.earth import magnetic_field_ned
from fusetune.execute.world.truth import Truth
from fusetune.px4.flight import TopicTable

DEVICE_ID = 396809
DISTURBANCE_EDGE_S = 1.0
"""A disturbance grows and fades over this time."""


def vehicle_magnetometer(
    truth: Truth, magnetometer: Magnetometer, environment: Environment, faults: Sequence[Fault], seed: int
) -> TopicTable:
    """Magnetometer samples in the layout of PX4's topic."""
    rng = random_stream(seed, "magnetometer")
    sampled_us = sample_times(truth, magnetometer.rate_hz, rng)
    frame = truth.frame
    earth_field = magnetic_field_ned(
        np.degrees(frame.lat_rad), np.degrees(frame.lon_rad), frame.height_m, environment.date
    )
    field = earth_field + _disturbance((sampled_us * 1e-6) - truth.events.takeoff_s, faults)
    hard_iron = magnetometer.hard_iron_gauss * rng.standard_normal(3)
    soft_iron = np.eye(3) + magnetometer.soft_iron * rng.standard_normal((3, 3))
    motor_field = magnetometer.current_gauss * unit_vectors(rng, 1)[0]
    # The current of a rotor grows with its thrust, the square of its speed.
    current = truth.at(sampled_us, truth.rotor_speed) ** 2
    body = truth.attitude_at(sampled_us).inv().apply(field) @ soft_iron.T + hard_iron + current[:, None] * motor_field
    body += magnetometer.noise_gauss * rng.standard_normal(body.shape)
    measured = body.astype(np.float32)
    return {
        "timestamp": (sampled_us + round(magnetometer.latency_ms * 1e3)).astype(np.int64),
        "timestamp_sample": sampled_us.astype(np.int64),
        "device_id": np.full(len(sampled_us), DEVICE_ID, np.uint32),
        **{f"magnetometer_ga[{axis}]": measured[:, axis] for axis in range(3)},
        "calibration_count": np.ones(len(sampled_us), np.uint8),
    }


def _disturbance(after_takeoff_s: np.ndarray, faults: Sequence[Fault]) -> np.ndarray:
    field = np.zeros((len(after_takeoff_s), 3))
    for fault in of_kind(faults, MagneticDisturbance):
        since_start = after_takeoff_s - fault.start_s
        until_end = fault.start_s + fault.duration_s - after_takeoff_s
        strength = np.clip(np.minimum(since_start, until_end) / DISTURBANCE_EDGE_S, 0.0, 1.0)
        field += strength[:, None] * np.array(fault.field_gauss)
    return field
