"""The simulated vehicle as its configuration file describes it: limits, airframe, weather, sensors."""

from __future__ import annotations

import datetime
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from fusetune.design.names import NAME_PATTERN, one_line
from fusetune.design.parameter_check import PARAMETER_PATTERN, parameter_problem, typed_values
from fusetune.settings.checking import raise_problems, read_checked
from fusetune.settings.declaration import built, required, setting
from fusetune.settings.schema import schema_of


@dataclass(frozen=True)
class Limits:
    """Limits of the planned path."""

    horizontal_speed_m_s: float = required("horizontal speed", unit="m/s", above=0, high=30)
    climb_speed_m_s: float = required("speed upwards", unit="m/s", above=0, high=15)
    descent_speed_m_s: float = required("speed downwards", unit="m/s", above=0, high=10)
    acceleration_m_s2: float = required("acceleration", unit="m/s²", above=0.2, high=8)
    jerk_m_s3: float = required("change of the acceleration", unit="m/s³", above=0.2, high=100)
    yaw_rate_deg_s: float = required("rate of turn", unit="degrees/s", above=1, high=360)
    yaw_acceleration_deg_s2: float = required("change of the rate of turn", unit="degrees/s²", above=5, high=1000)


@dataclass(frozen=True)
class Airframe:
    """What turns wanted acceleration into attitude and throttle."""

    hover_throttle: float = required("share of full throttle at hover", low=0.1, high=0.9)
    idle_throttle: float = required("share of full throttle when armed on the ground", low=0, high=0.5)
    linear_drag_1_s: float = required("rotor drag per mass", unit="1/s", low=0, high=5)
    quadratic_drag_1_m: float = required("body drag per mass", unit="1/m", low=0, high=1)
    gust_response_rad_s: float = required(
        "natural frequency of position control against gusts", unit="rad/s", low=0.3, high=10
    )
    gust_damping: float = required("damping ratio of position control", low=0.3, high=2)
    ground_roll_deg: float = required("roll on the ground", unit="degrees", low=-10, high=10)
    ground_pitch_deg: float = required("pitch on the ground", unit="degrees", low=-10, high=10)


@dataclass(frozen=True)
class Environment:
    """Day and weather of the flight."""

    date: datetime.date = required(
        "date of the flight (magnetic field, GNSS time), YYYY-MM-DD",
        pattern="^20[12][0-9]-[01][0-9]-[0-3][0-9]$",
    )
    wind_speed_m_s: float = required("mean wind", unit="m/s", low=0, high=20)
    wind_from_deg: float = required("direction the wind comes from", unit="degrees", low=0, high=360)
    turbulence_wind_m_s: float = required(
        "wind at 6 m height that sets the Dryden turbulence; 0 for none", unit="m/s", low=0, high=25
    )


@dataclass(frozen=True)
class InertialSensor:
    """Errors of an accelerometer (m/s²) or gyro (rad/s)."""

    noise_density: float = required("white noise of the sensor itself", unit="unit/√Hz", low=0, high=1)
    turn_on_bias: float = required("standard deviation of the bias at start", unit="unit", low=0, high=1)
    bias_random_walk: float = required("growth of the bias", unit="unit/√s", low=0, high=0.1)
    scale_error: float = required("standard deviation of the scale error", low=0, high=0.1)
    misalignment_deg: float = required(
        "standard deviation of the mounting error about each axis", unit="degrees", low=0, high=5
    )
    range: float = required("readings are clipped at plus and minus this", unit="unit", above=0, high=10000)


@dataclass(frozen=True)
class Vibration:
    """Vibration at hover; it grows with the square of the rotor speed."""

    rotor_frequency_hz: float = required("revolutions of a rotor at hover", unit="Hz", low=10, high=250)
    accelerometer_tone: float = required("amplitude per rotor at its frequency", unit="m/s²", low=0, high=50)
    accelerometer_density: float = required("broad-band", unit="m/s²/√Hz", low=0, high=1)
    gyro_tone: float = required("amplitude per rotor at its frequency", unit="rad/s", low=0, high=5)
    gyro_density: float = required("broad-band", unit="rad/s/√Hz", low=0, high=0.1)


@dataclass(frozen=True)
class Imu:
    """Inertial measurement unit."""

    raw_rate_hz: int = required("rate at which the sensor is read", unit="Hz", low=500, high=4000)
    rate_hz: int = required("rate of the integrated samples; divides raw_rate_hz", unit="Hz", low=100, high=500)
    accelerometer: InertialSensor = required("errors of the accelerometer", unit="m/s²")
    gyro: InertialSensor = required("errors of the gyro", unit="rad/s")
    vibration: Vibration = required()


@dataclass(frozen=True)
class Magnetometer:
    """Magnetometer."""

    rate_hz: float = required("rate of the samples", unit="Hz", low=5, high=100)
    noise_gauss: float = required("white noise per sample", unit="Gauss", low=0, high=0.5)
    hard_iron_gauss: float = required(
        "standard deviation of the constant field of the body", unit="Gauss", low=0, high=0.5
    )
    soft_iron: float = required("standard deviation of scale and cross-axis errors", low=0, high=0.2)
    current_gauss: float = required("field of the motor currents at hover", unit="Gauss", low=0, high=0.5)
    latency_ms: float = required("from sampling to publication", unit="ms", low=0, high=50)


@dataclass(frozen=True)
class Barometer:
    """Barometer."""

    rate_hz: float = required("rate of the samples", unit="Hz", low=1, high=100)
    noise_m: float = required("white noise per sample", unit="m", low=0, high=20)
    drift_m: float = required("standard deviation of the Gauss–Markov drift", unit="m", low=0, high=20)
    drift_time_s: float = required("correlation time of the drift", unit="s", above=0, high=10000)
    drift_rate_m_s: float = required(
        "standard deviation of the steady drift (weather, warming)", unit="m/s", low=0, high=0.5
    )
    offset_m: float = required("standard deviation of the constant offset (weather)", unit="m", low=0, high=200)
    ground_effect_m: float = required(
        "how much lower it reads in the wash on the ground at hover throttle", unit="m", low=0, high=10
    )
    ground_effect_height_m: float = required("height over which the effect falls to 1/e", unit="m", above=0, high=10)
    latency_ms: float = required("from sampling to publication", unit="ms", low=0, high=50)


@dataclass(frozen=True)
class GnssError:
    """White and time-correlated error of one horizontal axis, and how much larger the vertical one is."""

    noise: float = required("white noise per sample and horizontal axis", unit="unit", low=0, high=20)
    correlated: float = required(
        "standard deviation of the Gauss–Markov error per horizontal axis", unit="unit", low=0, high=20
    )
    correlation_time_s: float = required("correlation time of the Gauss–Markov error", unit="s", above=0, high=10000)
    vertical_factor: float = required("vertical error over horizontal error", low=0.5, high=5)


@dataclass(frozen=True)
class ReportedAccuracy:
    """Accuracy that the receiver reports."""

    eph_m: float = required("horizontal position", unit="m", above=0, high=50)
    epv_m: float = required("vertical position", unit="m", above=0, high=50)
    s_variance_m_s: float = required("velocity", unit="m/s", above=0, high=10)
    variation: float = required("relative standard deviation of these figures over time", low=0, high=0.5)


@dataclass(frozen=True)
class Gnss:
    """GNSS receiver."""

    rate_hz: float = required("rate of the samples", unit="Hz", low=1, high=20)
    delay_ms: float = required("from measurement to receipt", unit="ms", low=0, high=300)
    delay_jitter_ms: float = required("standard deviation of the delay", unit="ms", low=0, high=50)
    antenna_position_m: tuple[float, float, float] = required(
        "antenna in the body frame: forward, right, down of the IMU", unit="m", low=-2, high=2
    )
    position: GnssError = required("position error", unit="m")
    velocity: GnssError = required("velocity error", unit="m/s")
    reported: ReportedAccuracy = required()
    satellites: int = required("satellites used", low=6, high=50)
    hdop: float = required("horizontal dilution of precision", above=0, high=10)
    vdop: float = required("vertical dilution of precision", above=0, high=10)


@dataclass(frozen=True)
class Vehicle:
    """A simulated vehicle."""

    name: str = required("name of the vehicle", pattern=NAME_PATTERN)
    limits: Limits = required()
    airframe: Airframe = required()
    environment: Environment = required()
    imu: Imu = required()
    magnetometer: Magnetometer = required()
    barometer: Barometer = required()
    gnss: Gnss = required()
    parameters: dict[str, float] = setting(
        {}, "PX4 parameters that differ from PX4's defaults, whatever set is flown", pattern=PARAMETER_PATTERN
    )
    description: str = setting("", "what the vehicle is")


def load_vehicle(path: str | os.PathLike[str]) -> Vehicle:
    """Read and check a vehicle file; `UserError` as of `read_checked`, and for values that do not go together."""
    document = read_checked(path, schema_of(Vehicle))
    raise_problems(path, _problems(document), "Mend the named keys; config/vehicles/ holds examples")
    vehicle = built(Vehicle, document)
    return replace(vehicle, parameters=typed_values(vehicle.parameters), description=one_line(vehicle.description))


def _problems(document: Mapping[str, Any]) -> list[str]:
    problems = []
    try:
        datetime.date.fromisoformat(document["environment"]["date"])
    except ValueError:
        problems.append(f"environment.date is {document['environment']['date']!r}; expected a day of the calendar")
    imu = document["imu"]
    if imu["raw_rate_hz"] % imu["rate_hz"] or 1_000_000 % imu["raw_rate_hz"]:
        problems.append(
            f"imu.raw_rate_hz is {imu['raw_rate_hz']}; expected a multiple of imu.rate_hz ({imu['rate_hz']}) with a "
            "period of whole microseconds"
        )
    for name, value in document.get("parameters", {}).items():
        problem = parameter_problem(name, value)
        if problem:
            problems.append(f"parameters: {problem}")
    return problems
