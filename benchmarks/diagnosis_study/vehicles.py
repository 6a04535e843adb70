"""Vehicles and weather of the study: the shipped quadrotor with everything drawn that differs from one to the next."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from fusetune.execute.vehicle import (
    AirspeedSensor,
    Battery,
    OpticalFlow,
    RangeFinder,
    Vehicle,
    Vision,
    load_vehicle,
)

BASE = Path("config/vehicles/quadrotor.yaml")
RAW_RATE_HZ = 500
SUITES: tuple[tuple[str, ...], ...] = (
    (),
    ("range_finder",),
    ("range_finder", "optical_flow"),
    ("vision",),
    ("airspeed",),
)
SUITE_SHARES = (0.5, 0.15, 0.15, 0.12, 0.08)
"""Which sensors a vehicle has beside the usual ones, and how often."""
AIRSPEED_WIND = 0.25
"""A pitot tube tells the airspeed only of a vehicle that flies into the air with its nose: weather is calm then."""


def draw_vehicle(rng: np.random.Generator, sensors: Collection[str] | None = None, *, wind: bool = True) -> Vehicle:
    """A vehicle that is told all that it should be told, with sensors as good as many have.

    Parameters
    ----------
    sensors
        What it has beside the usual ones; drawn by default.
    wind
        Whether it flies in more than a breath of wind.
    """
    base = _base()
    if sensors is None:
        sensors = SUITES[int(rng.choice(len(SUITES), p=SUITE_SHARES))]
    speed, turbulence = rng.uniform(0.0, 6.0), rng.uniform(0.0, 6.0)
    shaking, worse = float(np.exp(rng.uniform(-1.0, 0.8))), float(np.exp(rng.uniform(-0.5, 0.5)))
    calm = (AIRSPEED_WIND if "airspeed" in sensors else 1.0) * (1.0 if wind else 0.1)
    vibration, gnss = base.imu.vibration, base.gnss
    antenna = (float(rng.uniform(-0.15, 0.1)), float(rng.uniform(-0.05, 0.05)), float(rng.uniform(-0.15, -0.02)))
    delay = float(np.rint(rng.uniform(70.0, 140.0)))
    vehicle = replace(
        base,
        limits=replace(base.limits, yaw_rate_deg_s=100.0, yaw_acceleration_deg_s2=250.0),
        airframe=replace(
            base.airframe,
            hover_throttle=float(rng.uniform(0.32, 0.55)),
            linear_drag_1_s=float(rng.uniform(0.12, 0.4)),
            quadratic_drag_1_m=float(rng.uniform(0.006, 0.02)),
            ground_roll_deg=float(rng.uniform(-1.5, 1.5)),
            ground_pitch_deg=float(rng.uniform(-1.5, 1.5)),
        ),
        environment=replace(
            base.environment,
            wind_speed_m_s=calm * speed,
            wind_from_deg=float(rng.uniform(0.0, 360.0)),
            turbulence_wind_m_s=calm * turbulence,
        ),
        imu=replace(
            base.imu,
            raw_rate_hz=RAW_RATE_HZ,
            vibration=replace(
                vibration,
                rotor_frequency_hz=float(rng.uniform(70.0, 115.0)),
                accelerometer_tone=shaking * vibration.accelerometer_tone,
                accelerometer_density=shaking * vibration.accelerometer_density,
                gyro_tone=shaking * vibration.gyro_tone,
                gyro_density=shaking * vibration.gyro_density,
            ),
        ),
        barometer=replace(base.barometer, ground_effect_m=float(rng.uniform(0.2, 0.8))),
        gnss=replace(
            gnss,
            rate_hz=float(rng.choice([5.0, 10.0])),
            delay_ms=delay,
            antenna_position_m=antenna,
            position=replace(
                gnss.position, noise=worse * gnss.position.noise, correlated=worse * gnss.position.correlated
            ),
            velocity=replace(
                gnss.velocity, noise=worse * gnss.velocity.noise, correlated=worse * gnss.velocity.correlated
            ),
            satellites=int(rng.integers(13, 22)),
        ),
        range_finder=_range_finder() if "range_finder" in sensors else None,
        optical_flow=_optical_flow(rng) if "optical_flow" in sensors else None,
        vision=_vision(rng) if "vision" in sensors else None,
        airspeed=AirspeedSensor(10.0, 1.0, 0.3, 60.0) if "airspeed" in sensors else None,
        battery=Battery(4, float(rng.uniform(10.0, 25.0)), 0.5, 0.02, 0.15),
    )
    return replace(vehicle, parameters=_told(vehicle))


@cache
def _base() -> Vehicle:
    return load_vehicle(BASE)


def _range_finder() -> RangeFinder:
    return RangeFinder(20.0, 0.02, 0.005, 0.1, 25.0, (0.05, 0.0, 0.04), 0.12, 5.0)


def _optical_flow(rng: np.random.Generator) -> OpticalFlow:
    delay = float(np.rint(rng.uniform(10.0, 60.0)))
    return OpticalFlow(50.0, 0.04, 0.003, 220, 7.4, 30.0, (0.06, 0.02, 0.04), 0.12, delay)


def _vision(rng: np.random.Generator) -> Vision:
    delay = float(np.rint(rng.uniform(20.0, 120.0)))
    return Vision(30.0, 0.02, 0.08, 60.0, 0.05, 0.4, 0.1, 0.1, 1.5, (0.1, 0.0, 0.02), delay)


def _told(vehicle: Vehicle) -> dict[str, float]:
    """What PX4 is told of the sensors that there are: where they are, how late, and to use them."""
    told = {"EKF2_GPS_DELAY": vehicle.gnss.delay_ms} | _place("GPS", vehicle.gnss.antenna_position_m)
    if vehicle.range_finder is not None:
        told |= {"EKF2_RNG_CTRL": 1, "EKF2_RNG_DELAY": vehicle.range_finder.delay_ms}
        told |= _place("RNG", vehicle.range_finder.position_m)
    if vehicle.optical_flow is not None:
        told |= {"EKF2_OF_CTRL": 1, "EKF2_OF_DELAY": vehicle.optical_flow.delay_ms}
        told |= _place("OF", vehicle.optical_flow.position_m)
    if vehicle.vision is not None:
        told |= {"EKF2_EV_CTRL": 15, "EKF2_EV_DELAY": vehicle.vision.delay_ms}
        told |= _place("EV", vehicle.vision.position_m)
    if vehicle.airspeed is not None:
        told |= {"EKF2_ARSP_THR": 4.0, "EKF2_ASP_DELAY": vehicle.airspeed.delay_ms}
    return told


def _place(sensor: str, position_m: tuple[float, float, float]) -> dict[str, float]:
    return {f"EKF2_{sensor}_POS_{axis}": round(value, 3) for axis, value in zip("XYZ", position_m, strict=True)}
