"""Where the vehicle flies, and how it turns: sinusoids that swell after the climb and fade before the descent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .jet import Jet, product, ramp, sinusoid

GROUND_S, END_S = 16.0, 4.0
"""On the ground before take-off, and after touch-down."""
CLIMB_S, SWELL_S = 6.0, 5.0
SPOOL_S = 0.8
"""The rotors carry the vehicle so long after they began to lift it, and before they let it down."""


@dataclass(frozen=True)
class Path:
    """The flight as a function of time.

    Attributes
    ----------
    time_s : (N,) since boot
    position : (3 axes, 3 derivatives, N) north, east, down from home
    yaw : (3 derivatives, N) rad
    lift : (N,) 0 on the ground, 1 in the air
    takeoff_s, touchdown_s : times
    """

    time_s: npt.NDArray[np.float64]
    position: npt.NDArray[np.float64]
    yaw: Jet
    lift: npt.NDArray[np.float64]
    takeoff_s: float
    touchdown_s: float


@dataclass(frozen=True)
class Wave:
    """A sinusoid: amplitude (m or rad), rate (rad/s), phase (rad)."""

    amplitude: float
    rate: float
    phase: float


@dataclass(frozen=True)
class Figure:
    """Waves of the four axes and the height of the flight, m."""

    north: tuple[Wave, ...]
    east: tuple[Wave, ...]
    down: tuple[Wave, ...]
    yaw: tuple[Wave, ...]
    height_m: float


def aggressive(rng: np.random.Generator) -> Figure:
    """A Lissajous figure at 8 to 10 m/s with 5 m/s² in its corners, turned by chance, and quick turns of the yaw."""
    rate = rng.uniform(0.55, 0.7)
    long, short = rng.uniform(6.5, 8.0) / rate, rng.uniform(2.8, 3.6) / (2.0 * rate)
    first = Wave(long, rate, rng.uniform(0.0, 2.0 * np.pi))
    second = Wave(short, 2.0 * rate, rng.uniform(0.0, 2.0 * np.pi))
    north, east = ((first,), (second,)) if rng.random() < 0.5 else ((second,), (first,))
    down = (Wave(rng.uniform(1.0, 2.0), rng.uniform(0.7, 1.1), rng.uniform(0.0, 2.0 * np.pi)),)
    yaw = (Wave(rng.uniform(0.8, 1.6), rng.uniform(0.4, 0.8), rng.uniform(0.0, 2.0 * np.pi)),)
    return Figure(north, east, down, yaw, rng.uniform(7.0, 12.0))


def gentle(rng: np.random.Generator) -> Figure:
    """Wide bows at 2 to 4 m/s."""

    def bows() -> tuple[Wave, ...]:
        return tuple(
            Wave(speed / rate, rate, rng.uniform(0.0, 2.0 * np.pi))
            for speed, rate in (
                (rng.uniform(1.2, 2.2), rng.uniform(0.12, 0.2)),
                (rng.uniform(0.4, 0.9), rng.uniform(0.3, 0.5)),
            )
        )

    down = (Wave(rng.uniform(1.0, 3.0), rng.uniform(0.15, 0.35), rng.uniform(0.0, 2.0 * np.pi)),)
    yaw = (Wave(rng.uniform(0.5, 1.4), rng.uniform(0.1, 0.3), rng.uniform(0.0, 2.0 * np.pi)),)
    return Figure(bows(), bows(), down, yaw, rng.uniform(6.0, 12.0))


def hover(rng: np.random.Generator) -> Figure:
    """Standing in the air with a slow wander of decimetres."""

    def wander(size: float) -> tuple[Wave, ...]:
        return tuple(
            Wave(size * rng.uniform(0.5, 1.0) / place, 2.0 * np.pi / period, rng.uniform(0.0, 2.0 * np.pi))
            for place, period in enumerate(rng.uniform((18.0, 7.0, 3.0), (35.0, 14.0, 5.0)), 1)
        )

    return Figure(wander(0.4), wander(0.4), wander(0.2), wander(0.12), rng.uniform(4.0, 10.0))


FIGURES = {"aggressive": aggressive, "gentle": gentle, "hover": hover}


def fly_path(kind: str, airborne_s: float, step_s: float, rng: np.random.Generator) -> Path:
    """A flight of a kind of `FIGURES`, from boot to the end of the log."""
    figure = FIGURES[kind](rng)
    takeoff_s, touchdown_s = GROUND_S, GROUND_S + airborne_s
    time = np.arange(round((touchdown_s + END_S) / step_s) + 1) * step_s
    up = ramp(time, takeoff_s, takeoff_s + CLIMB_S)
    down = ramp(time, touchdown_s - CLIMB_S, touchdown_s)
    height = figure.height_m * (down - up)
    swell = ramp(time, takeoff_s + 0.5 * CLIMB_S, takeoff_s + 0.5 * CLIMB_S + SWELL_S)
    fade = ramp(time, touchdown_s - CLIMB_S - SWELL_S, touchdown_s - 0.5 * CLIMB_S)
    envelope = swell - fade
    north, east, sink, turn = (
        sum(
            (product(envelope, sinusoid(time, one.amplitude, one.rate, one.phase)) for one in waves),
            np.zeros((3, time.size)),
        )
        for waves in (figure.north, figure.east, figure.down, figure.yaw)
    )
    turn[0] += rng.uniform(-np.pi, np.pi)
    lift = ramp(time, takeoff_s, takeoff_s + SPOOL_S)[0] - ramp(time, touchdown_s - SPOOL_S, touchdown_s)[0]
    return Path(time, np.array([north, east, height + sink]), turn, lift, takeoff_s, touchdown_s)
