"""The simulated vehicle as its configuration file describes it: limits, airframe, weather, sensors."""

from __future__ import annotations

import datetime
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fusetune.design.config_file import load_schema, raise_problems, validate
from fusetune.design.names import one_line
from fusetune.design.parameter_check import parameter_problem, typed_values
from fusetune.design.yaml_reader import read_yaml


@dataclass(frozen=True)
class Limits:
    """Limits of the planned path."""

    horizontal_speed_m_s: float
    climb_speed_m_s: float
    descent_speed_m_s: float
    acceleration_m_s2: float
    jerk_m_s3: float
    yaw_rate_deg_s: float
    yaw_acceleration_deg_s2: float


@dataclass(frozen=True)
class Airframe:
    """What turns wanted acceleration into attitude and throttle."""

    hover_throttle: float
    idle_throttle: float
    linear_drag_1_s: float
    quadratic_drag_1_m: float
    gust_response_rad_s: float
    gust_damping: float
    ground_roll_deg: float
    ground_pitch_deg: float


@dataclass(frozen=True)
class Environment:
    """Day and weather."""

    date: datetime.date
    wind_speed_m_s: float
    wind_from_deg: float
    turbulence_wind_m_s: float


@dataclass(frozen=True)
class InertialSensor:
    """Errors of an accelerometer (m/s²) or gyro (rad/s)."""

    noise_density: float
    turn_on_bias: float
    bias_random_walk: float
    scale_error: float
    misalignment_deg: float
    range: float


@dataclass(frozen=True)
class Vibration:
    """Vibration at hover; it grows with the square of the rotor speed."""

    rotor_frequency_hz: float
    accelerometer_tone: float
    accelerometer_density: float
    gyro_tone: float
    gyro_density: float


@dataclass(frozen=True)
class Imu:
    """Inertial measurement unit."""

    raw_rate_hz: int
    rate_hz: int
    accelerometer: InertialSensor
    gyro: InertialSensor
    vibration: Vibration


@dataclass(frozen=True)
class Magnetometer:
    """Magnetometer."""

    rate_hz: float
    noise_gauss: float
    hard_iron_gauss: float
    soft_iron: float
    current_gauss: float
    latency_ms: float


@dataclass(frozen=True)
class Barometer:
    """Barometer."""

    rate_hz: float
    noise_m: float
    drift_m: float
    drift_time_s: float
    drift_rate_m_s: float
    offset_m: float
    ground_effect_m: float
    ground_effect_height_m: float
    latency_ms: float


@dataclass(frozen=True)
class GnssError:
    """White and time-correlated error of one horizontal axis, and how much larger the vertical one is."""

    noise: float
    correlated: float
    correlation_time_s: float
    vertical_factor: float


@dataclass(frozen=True)
class ReportedAccuracy:
    """Accuracy that the receiver reports."""

    eph_m: float
    epv_m: float
    s_variance_m_s: float
    variation: float


@dataclass(frozen=True)
class Gnss:
    """GNSS receiver."""

    rate_hz: float
    delay_ms: float
    delay_jitter_ms: float
    antenna_position_m: tuple[float, float, float]
    position: GnssError
    velocity: GnssError
    reported: ReportedAccuracy
    satellites: int
    hdop: float
    vdop: float


@dataclass(frozen=True)
class Vehicle:
    """A simulated vehicle."""

    name: str
    limits: Limits
    airframe: Airframe
    environment: Environment
    imu: Imu
    magnetometer: Magnetometer
    barometer: Barometer
    gnss: Gnss
    parameters: dict[str, float]
    """Parameters that differ from PX4's defaults whatever set is flown."""
    description: str = ""


def load_vehicle(path: str | os.PathLike[str]) -> Vehicle:
    """Read and check a vehicle file.

    Raises
    ------
    UserError
        The file is broken; the message names every key at fault and what was expected.
    """
    document = read_yaml(path)
    validate(document, load_schema("fusetune.execute", "vehicle"), path)
    raise_problems(path, _problems(document), "Mend the named keys; config/vehicles/ holds examples")
    return _vehicle_of(document)


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


def _vehicle_of(document: Mapping[str, Any]) -> Vehicle:
    imu, gnss, environment = document["imu"], document["gnss"], document["environment"]
    return Vehicle(
        name=document["name"],
        limits=Limits(**document["limits"]),
        airframe=Airframe(**document["airframe"]),
        environment=Environment(**{**environment, "date": datetime.date.fromisoformat(environment["date"])}),
        imu=Imu(
            raw_rate_hz=imu["raw_rate_hz"],
            rate_hz=imu["rate_hz"],
            accelerometer=InertialSensor(**imu["accelerometer"]),
            gyro=InertialSensor(**imu["gyro"]),
            vibration=Vibration(**imu["vibration"]),
        ),
        magnetometer=Magnetometer(**document["magnetometer"]),
        barometer=Barometer(**document["barometer"]),
        gnss=Gnss(
            **{
                **gnss,
                "antenna_position_m": tuple(gnss["antenna_position_m"]),
                "position": GnssError(**gnss["position"]),
                "velocity": GnssError(**gnss["velocity"]),
                "reported": ReportedAccuracy(**gnss["reported"]),
            }
        ),
        parameters=typed_values(document.get("parameters", {})),
        description=one_line(document.get("description", "")),
    )
