"""What a flight's vehicle should be told, and what its sensors add: the truth that estimates are compared with."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fusetune.execute.sensors.barometer import ground_effect_depth_m, standard_atmosphere
from fusetune.execute.sensors.faults import (
    AirspeedScale,
    Fault,
    FlowScale,
    StaticPressure,
    VisionScale,
    VisionYaw,
    of_kind,
)
from fusetune.execute.sensors.magnetometer import magnetometer_errors
from fusetune.execute.vehicle import Vehicle

AXES = "xyz"
SEA_LEVEL_DENSITY_KG_M3 = 1.225
ALLAN_PEAK = 0.437 * math.sqrt(2.0)
"""Largest Allan deviation of a Gauss–Markov process over its standard deviation, at 1.89 correlation times: 0.437 q √T
where σ² = q² T / 2 (IEEE Std 952-1997, C.1.1.5)."""


def right_values(vehicle: Vehicle, faults: Sequence[Fault], seed: int, altitude_m: float) -> dict[str, float]:
    """True values of a simulated flight by name: parameters of PX4 as it should be told them, else with their unit.

    Parameters
    ----------
    vehicle, faults, seed
        Of the flight.
    altitude_m
        At which it flies, above mean sea level: drag depends on the density of the air.
    """
    return {
        **_delays(vehicle),
        **_positions(vehicle),
        **_drag(vehicle, altitude_m),
        **_pressure(faults),
        "EKF2_GND_EFF_DZ": ground_effect_depth_m(vehicle.barometer, faults),
        **_magnetometer(vehicle, faults, seed),
        **_inertial(vehicle),
        **_scales(faults),
    }


def _delays(vehicle: Vehicle) -> dict[str, float]:
    """Delays (ms) as PX4 is told them; magnetometer and barometer stamp the moment of the measurement."""
    sensors = {
        "GPS": vehicle.gnss,
        "RNG": vehicle.range_finder,
        "OF": vehicle.optical_flow,
        "EV": vehicle.vision,
        "ASP": vehicle.airspeed,
    }
    there = {f"EKF2_{name}_DELAY": sensor.delay_ms for name, sensor in sensors.items() if sensor is not None}
    return {"EKF2_MAG_DELAY": 0.0, "EKF2_BARO_DELAY": 0.0, **there}


def _positions(vehicle: Vehicle) -> dict[str, float]:
    """Places (m) of the sensors in the body frame, which begins at the IMU."""
    places = {"GPS": vehicle.gnss.antenna_position_m}
    for name, sensor in (("RNG", vehicle.range_finder), ("OF", vehicle.optical_flow), ("EV", vehicle.vision)):
        if sensor is not None:
            places[name] = sensor.position_m
    return {
        f"EKF2_{name}_POS_{axis.upper()}": value
        for name, place in places.items()
        for axis, value in zip(AXES, place, strict=True)
    }


def _drag(vehicle: Vehicle, altitude_m: float) -> dict[str, float]:
    """Ballistic coefficients (kg/m²) and momentum drag (1/s): PX4 has ½ ρ/BCOEF |v| v and MCOEF √(ρ/ρ₀) v."""
    density = float(standard_atmosphere(np.array(altitude_m))[2])
    airframe = vehicle.airframe
    drag = {"EKF2_MCOEF": airframe.linear_drag_1_s / math.sqrt(density / SEA_LEVEL_DENSITY_KG_M3)}
    if airframe.quadratic_drag_1_m > 0.0:
        coefficient = 0.5 * density / airframe.quadratic_drag_1_m
        drag |= {"EKF2_BCOEF_X": coefficient, "EKF2_BCOEF_Y": coefficient}
    return drag


def _pressure(faults: Sequence[Fault]) -> dict[str, float]:
    """Shares of the dynamic pressure, in PX4's sign: it adds to the barometer's height what they take from it."""
    found = of_kind(faults, StaticPressure)
    names = {"XP": "forward", "XN": "backward", "YP": "right", "YN": "left", "Z": "vertical"}
    return {f"EKF2_PCOEF_{name}": sum(getattr(fault, field) for fault in found) for name, field in names.items()}


def _magnetometer(vehicle: Vehicle, faults: Sequence[Fault], seed: int) -> dict[str, float]:
    """Field of the body (Gauss), and of the motors over throttle and over the battery's current."""
    errors = magnetometer_errors(vehicle.magnetometer, faults, seed)
    values = {f"hard_iron_{axis}_gauss": float(errors.hard_iron[index]) for index, axis in enumerate(AXES)}
    per_unit = {"throttle": vehicle.airframe.hover_throttle}
    if vehicle.battery is not None:
        per_unit["a"] = vehicle.battery.hover_current_a
    return values | {
        f"motor_field_{axis}_gauss_per_{unit}": float(errors.motor_field[index]) / at_hover
        for unit, at_hover in per_unit.items()
        for index, axis in enumerate(AXES)
    }


def _inertial(vehicle: Vehicle) -> dict[str, float]:
    """Noise densities, random walks and bias instabilities of the sensors themselves, without vibration."""
    units = {"gyro": ("rad_s", vehicle.imu.gyro), "accelerometer": ("m_s2", vehicle.imu.accelerometer)}
    return {
        f"{name}_{quantity}_{unit}_{per}": value
        for name, (unit, sensor) in units.items()
        for quantity, per, value in (
            ("noise_density", "per_root_hz", sensor.noise_density),
            ("bias_random_walk", "per_root_s", sensor.bias_random_walk),
        )
    } | {f"{name}_bias_instability_{unit}": ALLAN_PEAK * sensor.bias_wander for name, (unit, sensor) in units.items()}


def _scales(faults: Sequence[Fault]) -> dict[str, float]:
    """Readings over what they are of."""
    return {
        "airspeed_scale": math.prod(fault.factor for fault in of_kind(faults, AirspeedScale)),
        "flow_scale": math.prod(fault.factor for fault in of_kind(faults, FlowScale)),
        "vision_scale": math.prod(fault.factor for fault in of_kind(faults, VisionScale)),
        "vision_yaw_deg": math.fsum(fault.turned_deg for fault in of_kind(faults, VisionYaw)),
    }
