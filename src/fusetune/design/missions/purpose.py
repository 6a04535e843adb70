"""Missions made for a purpose: which motion tells which parameters, and shapes of it that fit into a field.

What has to be told apart needs motions in which only one of the two shows: the delay of GNSS shows while the vehicle
accelerates and not at all while it hovers, the noise of the accelerometer in both.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fusetune.design.missions.limits import PX4_LIMITS
from fusetune.errors import UserError
from fusetune.settings.checking import nearest

BRISK_M_S2 = 1.0
"""RMS of the change of horizontal velocity over a second from which a flight of a minute tells the delay of GNSS: below
0.4 (hovering) its interval reached 28 to 116 ms either way, between 0.7 and 1.1 mostly 12 to 60, above 3 mostly 3 to
20 (docs/next_flights.md)."""

TURNING_DEG_S = 20.0
"""RMS turning rate ω from which a flight tells a lever arm: N velocities with errors σ tell it to σ / (ω √N), which is
0.05 m for 0.3 m/s, 5 Hz, a minute."""

DELAY_MS = 10.0
"""Standard error of the delay of GNSS that a flight made for it aims at; two such flights tell it to ±15 ms."""
_VELOCITY_M_S, _GNSS_HZ = 0.3, 5.0
"""EKF2's default of EKF2_GPS_V_NOISE, and the rate of common receivers."""
HOVER_S = 40.0
_FASTEST_M_S = 10.0
_STEP_M, _CLIMB_M = 4.0, 10.0
_JERK_S = 2.0 * PX4_LIMITS.acceleration_m_s2 / PX4_LIMITS.jerk_m_s3
"""How long the acceleration builds up, as `flown_path` plans it."""


@dataclass(frozen=True)
class Field:
    """Where the mission is flown: a square around home, and how high."""

    side_m: float
    altitude_m: float


@dataclass(frozen=True)
class Motion:
    """A motion that tells parameters.

    Attributes
    ----------
    parameters : names, or how names begin, with a ``*`` at their end
    why : what the motion does for them, a clause
    shape : entry of `shapes` of a mission that fits into a field
    """

    parameters: tuple[str, ...]
    why: str
    shape: Callable[[Field], dict[str, Any]]

    def tells(self, parameter: str) -> bool:
        """Whether a parameter is among them."""
        return any(parameter.startswith(one[:-1]) if one.endswith("*") else parameter == one for one in self.parameters)


def _hover(field: Field) -> dict[str, Any]:
    return {"kind": "hover", "altitude_m": field.altitude_m, "duration_s": HOVER_S}


def _climb_steps(field: Field) -> dict[str, Any]:
    return {"kind": "climb_steps", "altitude_m": field.altitude_m, "step_m": _STEP_M, "steps": 3, "hold_s": 4.0}


def _yaw_turns(field: Field) -> dict[str, Any]:
    return {"kind": "yaw_turns", "altitude_m": field.altitude_m, "turns": 2}


def _runs(field: Field) -> dict[str, Any]:
    return {
        "kind": "runs",
        "altitude_m": field.altitude_m,
        "distance_m": field.side_m,
        "climb_m": _CLIMB_M,
        "speed_m_s": fastest_to_and_fro(field.side_m),
        "repeats": 2,
    }


def _shuttle(field: Field) -> dict[str, Any]:
    speed = fastest_to_and_fro(field.side_m)
    # velocity late by δ is off by a δ: the standard error of δ from N samples is σ / √(N a²), so ∫ a² dt has to be …
    wanted = (_VELOCITY_M_S / (1e-3 * DELAY_MS)) ** 2 / _GNSS_HZ
    # … and each time it turns back 2 v are gone through in the window of the velocity, smoothed by that of the jerk
    window = _velocity_window_s(speed)
    each = (2.0 * speed) ** 2 / window * (1.0 - _JERK_S / (3.0 * window))
    return {
        "kind": "shuttle",
        "altitude_m": field.altitude_m,
        "length_m": field.side_m,
        "legs": max(2 * math.ceil(0.5 * wanted / each), 6),
        "speed_m_s": speed,
        # a heading that stays: turning, a lever arm would look like a delay
        "heading_deg": 0.0,
    }


def _figure_eight(field: Field) -> dict[str, Any]:
    radius = 0.25 * field.side_m
    speed = min(math.floor(2.0 * math.sqrt(0.7 * PX4_LIMITS.acceleration_m_s2 * radius)) / 2.0, _FASTEST_M_S)
    return {
        "kind": "figure_eight",
        "altitude_m": field.altitude_m,
        "radius_m": radius,
        "speed_m_s": speed,
        "laps": 3,
    }


def _velocity_window_s(speed_m_s: float) -> float:
    """How long the vehicle accelerates to a speed, as `flown_path` plans it."""
    vertical = PX4_LIMITS.climb_speed_m_s + PX4_LIMITS.descent_speed_m_s
    return math.hypot(2.0 * speed_m_s, vertical) / PX4_LIMITS.acceleration_m_s2


def fastest_to_and_fro(length_m: float) -> float:
    """Largest speed, in halves of m/s, that is reached on a leg between two ends."""
    speeds = [0.5 * half for half in range(2, int(2.0 * _FASTEST_M_S) + 1)]
    return max((one for one in speeds if one * (_velocity_window_s(one) + _JERK_S) <= length_m), default=1.0)


MOTIONS: Mapping[str, Motion] = {
    "hover": Motion(
        (
            "EKF2_ACC_NOISE", "EKF2_GYR_NOISE", "EKF2_ACC_B_NOISE", "EKF2_GYR_B_NOISE",
            "EKF2_GPS_P_NOISE", "EKF2_GPS_V_NOISE",
        ),
        "hovering, the noises show alone: delays and lever arms do nothing",
        _hover,
    ),
    "climb_steps": Motion(
        ("EKF2_BARO_NOISE", "EKF2_BARO_DELAY", "EKF2_GND_*", "EKF2_RNG_*"),
        "climbing in steps tells heights that change from heights that stand",
        _climb_steps,
    ),
    "yaw_turns": Motion(
        (
            "EKF2_MAG_*", "EKF2_HEAD_NOISE", "EKF2_DECL_TYPE", "EKF2_GPS_POS_*", "EKF2_IMU_POS_*",
            "EKF2_EV_POS_*", "EKF2_OF_POS_*",
        ),
        "turning in place shows the compass at every heading, and a lever arm as a velocity",
        _yaw_turns,
    ),
    "runs": Motion(
        (
            "EKF2_BCOEF_*", "EKF2_MCOEF", "EKF2_DRAG_NOISE", "EKF2_PCOEF_*", "EKF2_WIND_NSD", "EKF2_ASPD_MAX",
        ),
        "fast along each axis of the vehicle with a heading that stays, and at rest between",
        _runs,
    ),
    "shuttle": Motion(
        (
            "EKF2_GPS_DELAY", "EKF2_EV_DELAY", "EKF2_OF_DELAY", "EKF2_GPS_V_NOISE", "EKF2_ACC_NOISE",
        ),
        "turning back hard, a late velocity is off by acceleration times delay",
        _shuttle,
    ),
    "figure_eight": Motion(
        ("EKF2_GPS_POS_*", "EKF2_IMU_POS_*", "EKF2_EV_POS_*", "EKF2_OF_*", "EKF2_GYR_NOISE", "EKF2_EV_DELAY"),
        "turning and leaning without rest, both ways",
        _figure_eight,
    ),
}  # fmt: skip
"""Kind of shape → what it tells, in the order in which they are flown."""


def motions_for(
    parameters: Sequence[str], asked_in: str | os.PathLike[str] = "the command line"
) -> dict[str, tuple[str, ...]]:
    """Kinds of shapes that tell some parameters, each with those that it tells.

    Raises
    ------
    UserError
        There is none for a parameter.
    """
    for one in parameters:
        if not any(motion.tells(one) for motion in MOTIONS.values()):
            known = [name.rstrip("*") for motion in MOTIONS.values() for name in motion.parameters]
            reason = f"no motion is known that tells {one!r}{nearest(one, known)}"
            raise UserError(asked_in, reason, f"Name parameters among {', '.join(_told())}")
    told = {kind: tuple(one for one in parameters if motion.tells(one)) for kind, motion in MOTIONS.items()}
    return {kind: names for kind, names in told.items() if names}


def _told() -> Iterable[str]:
    return dict.fromkeys(name for motion in MOTIONS.values() for name in motion.parameters)


def shapes_for(
    parameters: Sequence[str], field: Field, asked_in: str | os.PathLike[str] = "the command line"
) -> list[dict[str, Any]]:
    """Entries of `shapes` for a mission that tells some parameters apart; `UserError` as of `motions_for`."""
    return [MOTIONS[kind].shape(field) for kind in motions_for(parameters, asked_in)]
