"""Magnetometer (`vehicle_magnetometer`): the earth's field at home seen from the body, with its disturbances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from fusetune.execute.noise import random_stream, unit_vectors
from fusetune.execute.sensors.faults import (
    BodyField,
    Fault,
    MagneticDisturbance,
    MagnetometerRotation,
    MagnetometerScale,
    MotorField,
    of_kind,
)
from fusetune.execute.sensors.sampling import sample_times
from fusetune.execute.vehicle import Environment, Magnetometer
from fusetune.execute.world.earth import magnetic_field_ned
from fusetune.execute.world.truth import Truth
from fusetune.px4.flight import TopicTable

DEVICE_ID = 396809
DISTURBANCE_EDGE_S = 1.0
"""A disturbance grows and fades over this time."""


@dataclass(frozen=True)
class MagnetometerErrors:
    """What one magnetometer adds to the field of the body frame.

    Attributes
    ----------
    hard_iron : (3,) Gauss
    soft_iron : (3, 3)
    motor_field : (3,) Gauss at hover
    """

    hard_iron: np.ndarray
    soft_iron: np.ndarray
    motor_field: np.ndarray


def magnetometer_errors(magnetometer: Magnetometer, faults: Sequence[Fault], seed: int) -> MagnetometerErrors:
    """Errors as `vehicle_magnetometer` of this seed has them."""
    rng = random_stream(seed, "magnetometer")
    # The first draw is the phase of the samples.
    rng.uniform()
    return _drawn_errors(magnetometer, faults, rng)


def _drawn_errors(magnetometer: Magnetometer, faults: Sequence[Fault], rng: np.random.Generator) -> MagnetometerErrors:
    hard_iron = magnetometer.hard_iron_gauss * rng.standard_normal(3)
    soft_iron = np.eye(3) + magnetometer.soft_iron * rng.standard_normal((3, 3))
    motor_field = magnetometer.current_gauss * unit_vectors(rng, 1)[0]
    for body in of_kind(faults, BodyField):
        hard_iron = hard_iron + np.array(body.field_gauss)
    for motor in of_kind(faults, MotorField):
        motor_field = motor_field + np.array(motor.field_gauss)
    return MagnetometerErrors(hard_iron, soft_iron, motor_field)


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
    errors = _drawn_errors(magnetometer, faults, rng)
    # The current of a rotor grows with its thrust, the square of its speed.
    current = truth.at(sampled_us, truth.rotor_speed) ** 2
    body = truth.attitude_at(sampled_us).inv().apply(field) @ errors.soft_iron.T
    body = body + errors.hard_iron + current[:, None] * errors.motor_field
    body += magnetometer.noise_gauss * rng.standard_normal(body.shape)
    measured = _as_mounted(body, faults).astype(np.float32)
    return {
        "timestamp": (sampled_us + round(magnetometer.latency_ms * 1e3)).astype(np.int64),
        "timestamp_sample": sampled_us.astype(np.int64),
        "device_id": np.full(len(sampled_us), DEVICE_ID, np.uint32),
        **{f"magnetometer_ga[{axis}]": measured[:, axis] for axis in range(3)},
        "calibration_count": np.ones(len(sampled_us), np.uint8),
    }


def _as_mounted(body: np.ndarray, faults: Sequence[Fault]) -> np.ndarray:
    """Readings (N, 3) of a sensor that is scaled or turned otherwise than it is taken for."""
    for scaled in of_kind(faults, MagnetometerScale):
        body = body * np.array(scaled.scale)
    for turned in of_kind(faults, MagnetometerRotation):
        angles = (turned.yaw_deg, turned.pitch_deg, turned.roll_deg)
        body = Rotation.from_euler("ZYX", angles, degrees=True).inv().apply(body)
    return body


def _disturbance(after_takeoff_s: np.ndarray, faults: Sequence[Fault]) -> np.ndarray:
    field = np.zeros((len(after_takeoff_s), 3))
    for fault in of_kind(faults, MagneticDisturbance):
        since_start = after_takeoff_s - fault.start_s
        until_end = fault.start_s + fault.duration_s - after_takeoff_s
        strength = np.clip(np.minimum(since_start, until_end) / DISTURBANCE_EDGE_S, 0.0, 1.0)
        field += strength[:, None] * np.array(fault.field_gauss)
    return field
