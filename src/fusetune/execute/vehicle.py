"""The simulated vehicle as its configuration file describes it: limits, airframe, weather, sensors."""

from __future__ import annotations

import datetime
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from fusetune.design.missions.endurance import Drag, Endurance
from fusetune.design.missions.limits import Limits
from fusetune.design.names import NAME_PATTERN, one_line
from fusetune.design.parameter_check import PARAMETER_PATTERN, parameter_problem, typed_values
from fusetune.settings.checking import raise_problems, read_checked
from fusetune.settings.declaration import built, required, setting
from fusetune.settings.schema import schema_of


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
    bias_wander: float = setting(0.0, "standard deviation of a Gauss–Markov bias", unit="unit", low=0, high=1)
    bias_wander_time_s: float = setting(100.0, "correlation time of that bias", unit="s", above=0, high=10000)


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
class RangeFinder:
    """Range finder that looks down; the ground is flat, as high as home.

    A Benewake TFmini Plus has 1 cm repeatability, 5 cm accuracy below 6 m and 1 % beyond, up to 12 m (its data sheet).
    """

    rate_hz: float = required("rate of the samples", unit="Hz", low=1, high=100)
    noise_m: float = required("white noise per sample", unit="m", low=0, high=2)
    noise_share: float = required("white noise per sample over the distance", low=0, high=0.2)
    minimum_m: float = required("shortest distance that is measured", unit="m", low=0, high=5)
    maximum_m: float = required("longest distance that is measured", unit="m", above=0, high=200)
    position_m: tuple[float, float, float] = required(
        "sensor in the body frame: forward, right, down of the IMU", unit="m", low=-2, high=2
    )
    ground_distance_m: float = required("distance that it reads when the vehicle stands", unit="m", low=0, high=2)
    delay_ms: float = required("from measurement to publication", unit="ms", low=0, high=300)


@dataclass(frozen=True)
class OpticalFlow:
    """Optical flow sensor that looks down, with a gyro of its own.

    A PixArt PAW3902 or PMW3901 follows 7.4 rad/s from 0.08 m on (their data sheets).
    """

    rate_hz: float = required("rate of the samples; each integrates from the one before", unit="Hz", low=2, high=150)
    noise_rad_s: float = required("white noise of the flow per sample", unit="rad/s", low=0, high=2)
    gyro_noise_rad_s: float = required("white noise of its gyro per sample", unit="rad/s", low=0, high=1)
    quality: int = required("quality that it reports", low=0, high=255)
    maximum_rate_rad_s: float = required("largest flow that it follows", unit="rad/s", above=0, high=100)
    maximum_distance_m: float = required("largest distance from the ground", unit="m", above=0, high=200)
    position_m: tuple[float, float, float] = required(
        "sensor in the body frame: forward, right, down of the IMU", unit="m", low=-2, high=2
    )
    ground_distance_m: float = required("distance of the sensor from the ground on the ground", unit="m", low=0, high=2)
    delay_ms: float = required("from the end of the integration to the sample time", unit="ms", low=0, high=300)


@dataclass(frozen=True)
class Vision:
    """External vision: position, velocity and attitude of a camera in north, east, down.

    Visual-inertial odometry drifts by about one percent of the way (Delmerico and Scaramuzza, ICRA 2018).
    """

    rate_hz: float = required("rate of the samples", unit="Hz", low=1, high=120)
    position_noise_m: float = required("white noise of the position per sample and axis", unit="m", low=0, high=5)
    position_wander_m: float = required(
        "standard deviation of the Gauss–Markov error of the position per axis", unit="m", low=0, high=20
    )
    position_wander_time_s: float = required("correlation time of that error", unit="s", above=0, high=10000)
    velocity_noise_m_s: float = required("white noise of the velocity per sample and axis", unit="m/s", low=0, high=5)
    attitude_noise_deg: float = required("white noise of the attitude about each axis", unit="degrees", low=0, high=20)
    claimed_position_m: float = required("standard deviation of the position that it claims", unit="m", low=0, high=20)
    claimed_velocity_m_s: float = required("the same of the velocity", unit="m/s", low=0, high=10)
    claimed_attitude_deg: float = required("the same of the attitude", unit="degrees", low=0, high=45)
    position_m: tuple[float, float, float] = required(
        "camera in the body frame: forward, right, down of the IMU", unit="m", low=-2, high=2
    )
    delay_ms: float = required("from the picture to the sample time", unit="ms", low=0, high=300)


@dataclass(frozen=True)
class AirspeedSensor:
    """Pitot tube along the body's forward axis.

    A Sensirion SDP33 repeats its zero to 0.1 Pa; what is left after zeroing and in the tube is some tenths of a pascal.
    """

    rate_hz: float = required("rate of the samples", unit="Hz", low=1, high=50)
    noise_pa: float = required("white noise of the pressure per sample", unit="Pa", low=0, high=50)
    offset_pa: float = required("standard deviation of what zeroing leaves", unit="Pa", low=0, high=50)
    delay_ms: float = required("from the pressure at the tube to the sample time", unit="ms", low=0, high=300)


@dataclass(frozen=True)
class Battery:
    """Battery with a current sensor."""

    cells: int = required("cells in series", low=1, high=14)
    hover_current_a: float = required("current at hover; it grows with the thrust", unit="A", above=0, high=1000)
    avionics_current_a: float = required("current that always flows", unit="A", low=0, high=50)
    resistance_ohm: float = required("internal resistance of all cells", unit="Ω", low=0, high=1)
    current_noise_a: float = required("white noise of the current per sample", unit="A", low=0, high=50)


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
    range_finder: RangeFinder | None = setting(None, "range finder that looks down; without it there is none")
    optical_flow: OpticalFlow | None = setting(None, "optical flow sensor; without it there is none")
    vision: Vision | None = setting(None, "external vision; without it there is none")
    airspeed: AirspeedSensor | None = setting(None, "pitot tube; without it there is none")
    battery: Battery | None = setting(None, "battery with a current sensor; without it none is logged")
    endurance: Endurance | None = setting(None, "how long it flies; without it no share of the battery is told")
    parameters: dict[str, float] = setting(
        {}, "PX4 parameters that differ from PX4's defaults, whatever set is flown", pattern=PARAMETER_PATTERN
    )
    description: str = setting("", "what the vehicle is")

    @property
    def drag(self) -> Drag:
        """Its drag in the air."""
        return Drag(self.airframe.linear_drag_1_s, self.airframe.quadratic_drag_1_m)


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
