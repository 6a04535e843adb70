"""What a world of the second simulator is: which flights are flown in it, and by how much its sensors err.

Standard deviations named "spread" are those of a constant that each flight draws for itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, TypeVar


@dataclass(frozen=True)
class Inertial:
    """Accelerometer (m/s²) or gyro (rad/s).

    Attributes
    ----------
    density : of the white noise, unit/√Hz
    scale_spread, misalignment_spread_deg : of each axis
    bias_spread, warming_spread : of the turn-on bias, and of what warming up adds to it in the end, unit
    vibration : standard deviation in flight, unit
    """

    density: float
    scale_spread: float
    misalignment_spread_deg: float
    bias_spread: float
    warming_spread: float
    vibration: float


@dataclass(frozen=True)
class Imu:
    """Rate of the integrated samples, and the two sensors; the vibration has its resonance at `resonance_hz`."""

    rate_hz: int = 250
    accelerometer: Inertial = Inertial(0.004, 0.006, 0.4, 0.12, 0.04, 0.3)
    gyro: Inertial = Inertial(0.0002, 0.003, 0.25, 0.005, 0.001, 0.01)
    warming_time_s: float = 80.0
    resonance_hz: float = 38.0
    damping: float = 0.15


@dataclass(frozen=True)
class Wander:
    """White noise and a first-order Markov error beside it, alike north and east and 1.5 times as large vertically."""

    white: float
    markov: float
    markov_time_s: float


@dataclass(frozen=True)
class Gnss:
    """The receiver: rate, true delay, where its antenna is (m from the IMU, FRD), errors of velocity (m/s) and position
    (m), and the accuracies that it reports."""

    rate_hz: float = 5.0
    delay_ms: float = 110.0
    antenna_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    velocity: Wander = Wander(0.1, 0.0, 1.0)
    position: Wander = Wander(0.06, 0.5, 45.0)
    reported_velocity_m_s: float = 0.08
    reported_position_m: float = 0.4


@dataclass(frozen=True)
class Magnetometer:
    """Noise, hard iron (Gauss) and soft iron."""

    rate_hz: float = 40.0
    noise_gauss: float = 0.006
    hard_iron_spread_gauss: float = 0.006
    soft_iron_spread: float = 0.01


@dataclass(frozen=True)
class Barometer:
    """Noise, slow wander, what the rotors' wash adds at the ground (m) and what the airspeed does (m per m²/s²)."""

    rate_hz: float = 25.0
    noise_m: float = 0.15
    wander_m: float = 0.4
    wander_time_s: float = 35.0
    wash_m: float = 0.9
    airspeed_error: float = 0.008


WIDE_CHECKS = {"EKF2_REQ_HDRIFT": 1.0, "EKF2_REQ_VDRIFT": 1.5, "EKF2_REQ_SACC": 1.0}
"""A receiver that wanders looks like drift to the checks before take-off. Without wider limits GNSS is first used
somewhere in the air, and until then the heading is off by the declination, which follows from the place."""


@dataclass(frozen=True)
class SecondWorld:
    """A world; flight number n is of kind `kinds[n mod K]` and lasts `airborne_s` in the air.

    Attributes
    ----------
    parameters : what the vehicle flies beside PX4's defaults
    default_profile : the log holds what PX4's default logging profile leaves of it, from arming on
    """

    name: str
    kinds: tuple[str, ...] = ("aggressive", "gentle", "hover", "aggressive", "gentle", "aggressive", "gentle", "hover")
    airborne_s: float = 70.0
    imu: Imu = field(default_factory=Imu)
    gnss: Gnss = field(default_factory=Gnss)
    magnetometer: Magnetometer = field(default_factory=Magnetometer)
    barometer: Barometer = field(default_factory=Barometer)
    wind_m_s: float = 3.0
    parameters: Mapping[str, float] = field(default_factory=lambda: dict(WIDE_CHECKS))
    default_profile: bool = False


def second_world(name: str, changes: Mapping[str, Any]) -> SecondWorld:
    """The world of this name: the usual one with some settings changed, nested as they are.

    Raises
    ------
    TypeError
        There is no such setting.
    """
    return _changed(SecondWorld(name), changes)


Settings = TypeVar("Settings")


def _changed(base: Settings, changes: Mapping[str, Any]) -> Settings:
    assert is_dataclass(base)
    known = {one.name for one in fields(base)}
    if unknown := sorted(set(changes) - known):
        raise TypeError(f"{type(base).__name__} has no setting {', '.join(unknown)}")
    values = {}
    for name, value in changes.items():
        now = getattr(base, name)
        values[name] = _changed(now, value) if is_dataclass(now) else tuple(value) if isinstance(now, tuple) else value
    return replace(base, **values)
