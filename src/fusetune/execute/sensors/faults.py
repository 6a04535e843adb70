"""Faults that can be switched on for a simulated flight."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from fusetune.design.parameter_check import PARAMETER_PATTERN
from fusetune.settings.checking import read_checked, validate
from fusetune.settings.declaration import required, setting
from fusetune.settings.kinds import built_of_kind, schema_of_kinds

if TYPE_CHECKING:
    import numpy as np

Vector = tuple[float, float, float]
F = TypeVar("F")

_FINITE: dict[str, Any] = {"low": -100_000, "high": 100_000}


@dataclass(frozen=True)
class TimedFault:
    """A fault with a beginning and an end."""

    start_s: float = required("start, after take-off (negative: before)", unit="s", low=-600, high=3600)
    duration_s: float = required("duration", unit="s", above=0, high=3600)

    def holds(self, time_after_takeoff_s: np.ndarray) -> np.ndarray:
        """Whether the fault is on at the given times; (N,) bool."""
        return (time_after_takeoff_s >= self.start_s) & (time_after_takeoff_s < self.start_s + self.duration_s)


@dataclass(frozen=True)
class GnssOutage(TimedFault):
    """No GNSS: the receiver reports no fix, or sends nothing when `silent`."""

    silent: bool = setting(False, "true when the receiver sends nothing, false when it reports no fix")


@dataclass(frozen=True)
class GnssGlitch(TimedFault):
    """GNSS is off by a constant while its reported accuracy stays good."""

    offset_m: Vector = required("position error: north, east, down", unit="m", **_FINITE)
    velocity_offset_m_s: Vector = setting((0.0, 0.0, 0.0), "velocity error: north, east, down", unit="m/s", **_FINITE)


@dataclass(frozen=True)
class MagneticDisturbance(TimedFault):
    """An additional field, as of steel or a power line, that comes and goes smoothly."""

    field_gauss: Vector = required("additional field: north, east, down", unit="Gauss", **_FINITE)


@dataclass(frozen=True)
class StrongVibration(TimedFault):
    """The vehicle's vibration multiplied."""

    factor: float = required("vibration is multiplied by this", above=0, high=100)


@dataclass(frozen=True)
class Clipping(TimedFault):
    """Shaking beyond the range of the accelerometer."""

    amplitude_m_s2: float = setting(220.0, "amplitude of the shaking", unit="m/s²", above=0, high=1000)
    frequency_hz: float = setting(61.0, "frequency of the shaking", unit="Hz", low=5, high=400)


@dataclass(frozen=True)
class LoggerDropout(TimedFault):
    """The logger loses everything for a while and says so."""


@dataclass(frozen=True)
class DefaultProfile:
    """The log holds what PX4's default logging profile keeps: thinned topics, some IMU samples missing."""

    imu_loss: float = setting(0.03, "share of missing sensor_combined messages", low=0, high=0.5)
    from_arming: bool = setting(True, "true when the log starts at arming, false from boot")


@dataclass(frozen=True)
class AliasedVibration:
    """Shaking close to the IMU's sampling frequency: an offset that grows with the thrust, and a beat."""

    offset_m_s2: Vector = required("offset of the accelerometer at hover: forward, right, down", unit="m/s²", **_FINITE)
    beat_m_s2: float = setting(0.0, "amplitude of the beat along the same direction", unit="m/s²", low=0, high=100)
    beat_hz: float = setting(1.7, "frequency of the beat", unit="Hz", above=0, high=100)


@dataclass(frozen=True)
class GyroBias:
    """The gyro's bias is large from the start, or changes while the sensor warms."""

    turn_on_rad_s: Vector = setting((0.0, 0.0, 0.0), "from the start: forward, right, down", unit="rad/s", **_FINITE)
    warming_rad_s: Vector = setting((0.0, 0.0, 0.0), "what warming adds in the end", unit="rad/s", **_FINITE)
    warming_time_s: float = setting(30.0, "time in which 63 % of that come", unit="s", above=0, high=3600)


@dataclass(frozen=True)
class AccelerometerBias:
    """The accelerometer's bias is larger than calibration leaves."""

    bias_m_s2: Vector = required("forward, right, down", unit="m/s²", **_FINITE)


@dataclass(frozen=True)
class ImuGaps(TimedFault):
    """IMU samples are lost before the estimator gets them."""

    share: float = required("share of the samples that are lost", above=0, high=0.9)
    longest: int = setting(4, "most samples lost in a row", low=1, high=500)


@dataclass(frozen=True)
class BodyField:
    """A constant field of the body that was not calibrated."""

    field_gauss: Vector = required("forward, right, down", unit="Gauss", **_FINITE)


@dataclass(frozen=True)
class MotorField:
    """A field that grows with the current of the motors."""

    field_gauss: Vector = required("at hover: forward, right, down", unit="Gauss", **_FINITE)


@dataclass(frozen=True)
class MagnetometerRotation:
    """The magnetometer is mounted otherwise than PX4 is told."""

    roll_deg: float = setting(0.0, "turn about the forward axis, last", unit="degrees", low=-180, high=180)
    pitch_deg: float = setting(0.0, "turn about the right axis", unit="degrees", low=-180, high=180)
    yaw_deg: float = setting(0.0, "turn about the down axis, first", unit="degrees", low=-180, high=180)


@dataclass(frozen=True)
class MagnetometerScale:
    """The magnetometer is scaled wrongly."""

    scale: Vector = required("reading over field: forward, right, down", low=0.1, high=10)


@dataclass(frozen=True)
class GnssAccuracy(TimedFault):
    """GNSS errs more, and says so."""

    factor: float = required("errors and reported accuracies are multiplied by this", above=0, high=100)


@dataclass(frozen=True)
class GnssInterference(TimedFault):
    """A jammer: noise, fewer satellites, poor accuracy, a fix that flickers."""

    strength: float = required("1: all but the strongest satellites are lost", above=0, high=1)


@dataclass(frozen=True)
class GroundEffect:
    """The barometer reads lower near the ground than the vehicle's file says."""

    depth_m: float = required("how much lower on the ground at hover throttle", unit="m", low=0, high=20)


@dataclass(frozen=True)
class StaticPressure:
    """The pressure at the barometer is off by shares of the dynamic pressure along the body's axes."""

    forward: float = setting(0.0, "share where air comes from ahead", low=-10, high=10)
    backward: float = setting(0.0, "share where air comes from behind", low=-10, high=10)
    right: float = setting(0.0, "share where air comes from the right", low=-10, high=10)
    left: float = setting(0.0, "share where air comes from the left", low=-10, high=10)
    vertical: float = setting(0.0, "share where air comes from below or above", low=-10, high=10)


@dataclass(frozen=True)
class PropellerWash:
    """The barometer follows the throttle."""

    height_m: float = required("how much higher it reads at hover than with rotors at rest", unit="m", low=-50, high=50)


@dataclass(frozen=True)
class BarometerDrift(TimedFault):
    """Sunlight, warming or weather lets the barometer drift; what it drifted stays."""

    height_m: float = required("how much higher it reads in the end", unit="m", low=-200, high=200)


@dataclass(frozen=True)
class RangeObstruction(TimedFault):
    """Something in the beam: a constant short distance, flickering where the share is small, as in fog."""

    distance_m: float = required("distance that is read", unit="m", low=0, high=100)
    share: float = setting(1.0, "share of the readings", above=0, high=1)


@dataclass(frozen=True)
class RangeStep(TimedFault):
    """Something of a certain height stands below the vehicle."""

    height_m: float = required("how much shorter the distance is", unit="m", low=-50, high=50)


@dataclass(frozen=True)
class FlowScale:
    """The flow is scaled wrongly."""

    factor: float = required("reading over flow", above=0, high=10)


@dataclass(frozen=True)
class FlowRotation:
    """The flow sensor is turned about its axis, or its gyro does not tell how it turns."""

    turned_deg: float = setting(
        0.0, "turn of flow against body, about the down axis", unit="degrees", low=-180, high=180
    )
    gyro_share: float = setting(1.0, "reading of its gyro over the rate", low=-2, high=2)


@dataclass(frozen=True)
class VisionYaw:
    """The frame of vision is turned against north."""

    turned_deg: float = required("turn about the down axis", unit="degrees", low=-180, high=180)


@dataclass(frozen=True)
class VisionScale:
    """Vision is scaled wrongly, as with one camera."""

    factor: float = required("reading over way", above=0, high=10)


@dataclass(frozen=True)
class VisionCovariance:
    """Vision errs by far more, or less, than it claims."""

    error_factor: float = setting(1.0, "errors are multiplied by this", above=0, high=100)
    claimed_factor: float = setting(1.0, "claimed standard deviations are multiplied by this", above=0, high=100)


@dataclass(frozen=True)
class AirspeedScale:
    """Airspeed is scaled wrongly."""

    factor: float = required("reading over airspeed", above=0, high=10)


@dataclass(frozen=True)
class SensorStuck(TimedFault):
    """A sensor repeats its last reading."""

    sensor: Literal["magnetometer", "barometer", "gnss", "range_finder"] = required("which sensor")


@dataclass(frozen=True)
class ToldWrong:
    """PX4 is told a value other than the vehicle's file and the flown set say."""

    parameter: str = required("name of a parameter of EKF2", pattern=PARAMETER_PATTERN)
    value: float = required("what it is told", low=-1e9, high=1e9)


@dataclass(frozen=True)
class InstanceWhipsaw(TimedFault):
    """There are two IMUs with an estimator each, and the selector goes to and fro between them."""

    interval_s: float = required("time from one switch to the next", unit="s", above=0.05, high=600)


KINDS: dict[str, type[Any]] = {
    "gnss_outage": GnssOutage,
    "gnss_glitch": GnssGlitch,
    "gnss_accuracy": GnssAccuracy,
    "gnss_interference": GnssInterference,
    "magnetic_disturbance": MagneticDisturbance,
    "body_field": BodyField,
    "motor_field": MotorField,
    "magnetometer_rotation": MagnetometerRotation,
    "magnetometer_scale": MagnetometerScale,
    "vibration": StrongVibration,
    "aliased_vibration": AliasedVibration,
    "clipping": Clipping,
    "gyro_bias": GyroBias,
    "accelerometer_bias": AccelerometerBias,
    "imu_gaps": ImuGaps,
    "ground_effect": GroundEffect,
    "static_pressure": StaticPressure,
    "propeller_wash": PropellerWash,
    "baro_drift": BarometerDrift,
    "range_obstruction": RangeObstruction,
    "range_step": RangeStep,
    "flow_scale": FlowScale,
    "flow_rotation": FlowRotation,
    "vision_yaw": VisionYaw,
    "vision_scale": VisionScale,
    "vision_covariance": VisionCovariance,
    "airspeed_scale": AirspeedScale,
    "sensor_stuck": SensorStuck,
    "instance_whipsaw": InstanceWhipsaw,
    "told_wrong": ToldWrong,
    "logger_dropout": LoggerDropout,
    "default_profile": DefaultProfile,
}

Fault = (
    GnssOutage
    | GnssGlitch
    | GnssAccuracy
    | GnssInterference
    | MagneticDisturbance
    | BodyField
    | MotorField
    | MagnetometerRotation
    | MagnetometerScale
    | StrongVibration
    | AliasedVibration
    | Clipping
    | GyroBias
    | AccelerometerBias
    | ImuGaps
    | GroundEffect
    | StaticPressure
    | PropellerWash
    | BarometerDrift
    | RangeObstruction
    | RangeStep
    | FlowScale
    | FlowRotation
    | VisionYaw
    | VisionScale
    | VisionCovariance
    | AirspeedScale
    | SensorStuck
    | InstanceWhipsaw
    | ToldWrong
    | LoggerDropout
    | DefaultProfile
)


def load_faults(path: str | os.PathLike[str]) -> tuple[Fault, ...]:
    """Read a YAML file that holds a list `faults`.

    Raises
    ------
    UserError
        The file is broken; the message names the entry, the key and what was expected.
    """
    return parse_faults(read_checked(path, _SCHEMA | {"additionalProperties": False})["faults"], path)


def parse_faults(entries: Sequence[Mapping[str, Any]], file: str | os.PathLike[str] = "faults") -> tuple[Fault, ...]:
    """Faults from the list of mappings that a configuration file holds.

    Parameters
    ----------
    entries
        Each with `kind`, a name of `KINDS`, and the settings of that class.
    file
        Named in messages.

    Raises
    ------
    UserError
        An entry is broken; the message names the entry, the key and what was expected.
    """
    validate({"faults": list(entries)}, _SCHEMA, file)
    return tuple(built_of_kind(KINDS, entry) for entry in entries)


_SCHEMA = schema_of_kinds("faults", KINDS, "list of faults", "what goes wrong")


def of_kind(faults: Sequence[Fault], kind: type[F]) -> list[F]:
    """The faults of one kind."""
    return [fault for fault in faults if isinstance(fault, kind)]
