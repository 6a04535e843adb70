"""How a flight moved: what it can tell of parameters that show in some manoeuvres alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Interval
from fusetune.quaternions import conjugate, multiply, rotation_vector

Array = npt.NDArray[np.float64]

STEP_S = 0.1
"""Attitude and velocity are looked at so often: slower than vibration, faster than any manoeuvre."""
_OVER_S = 1.0
"""Changes of velocity are taken over so long: errors of the estimated velocity are small beside them."""
HOVER_M_S = 0.5
CLIMB_M_S = 0.3


@dataclass(frozen=True)
class Excitation:
    """How the scored part of a flight moved.

    Attributes
    ----------
    seconds : looked at
    horizontal_acceleration_m_s2, vertical_acceleration_m_s2 : RMS of the change of velocity over a second
    roll_pitch_rate_deg_s, yaw_rate_deg_s : RMS of the turning rate about the body's x and y axes together, and its z
        axis
    turned_deg : heading changes, added up whatever their direction
    climbed_m : height gained and lost, added up, while faster than `CLIMB_M_S`
    hover_share : of the time, slower than `HOVER_M_S` in all axes
    """

    seconds: float
    horizontal_acceleration_m_s2: float
    vertical_acceleration_m_s2: float
    roll_pitch_rate_deg_s: float
    yaw_rate_deg_s: float
    turned_deg: float
    climbed_m: float
    hover_share: float

    def document(self) -> dict[str, float]:
        """As a result file holds it."""
        return {name: round(value, 4) for name, value in asdict(self).items()}


def excitation(
    time: npt.NDArray[np.int64], velocity: Array, quaternion: Array, intervals: Sequence[Interval]
) -> Excitation | None:
    """Look at the motion in some intervals; None where they are shorter than two seconds in all.

    Parameters
    ----------
    time : (N,) µs, ascending
    velocity : (N, 3) NED, m/s
    quaternion : (N, 4) w, x, y, z; body → NED
    intervals : µs
    """
    pieces = [one for start, stop in intervals if (one := _piece(time, velocity, quaternion, start, stop))]
    if not pieces:
        return None
    gained, rates, speeds, headings = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    climb = np.abs(speeds[:, 2])
    return Excitation(
        seconds=STEP_S * len(speeds),
        horizontal_acceleration_m_s2=_rms(gained[:, :2]),
        vertical_acceleration_m_s2=_rms(gained[:, 2:]),
        roll_pitch_rate_deg_s=math.degrees(_rms(rates[:, :2])),
        yaw_rate_deg_s=math.degrees(_rms(rates[:, 2:])),
        turned_deg=float(np.degrees(np.abs(headings).sum())),
        climbed_m=float(STEP_S * climb[climb > CLIMB_M_S].sum()),
        hover_share=float(np.mean(np.linalg.norm(speeds, axis=1) < HOVER_M_S)),
    )


def _piece(
    time: npt.NDArray[np.int64], velocity: Array, quaternion: Array, start: int, stop: int
) -> tuple[Array, Array, Array, Array] | None:
    """Accelerations (N, 3) m/s², turning rates (N, 3) rad/s, velocities, and changes of heading over a second."""
    wanted = np.arange(start, stop, int(STEP_S * 1e6))
    wanted = wanted[(wanted >= time[0]) & (wanted <= time[-1])] if time.size else wanted[:0]
    over = round(_OVER_S / STEP_S)
    if wanted.size <= over:
        return None
    nearest = np.clip(np.searchsorted(time, wanted), 0, time.size - 1)
    speeds = np.column_stack([np.interp(wanted, time, axis) for axis in velocity.T])
    attitude = quaternion[nearest]
    elapsed = np.maximum(np.diff(time[nearest]) * 1e-6, 1e-3)[:, None]
    rates = rotation_vector(multiply(conjugate(attitude[:-1]), attitude[1:])) / elapsed
    # heading by seconds, so that estimation noise does not add up
    w, x, y, z = attitude[::over].T
    heading = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    return (speeds[over:] - speeds[:-over]) / _OVER_S, rates, speeds, np.diff(heading)


def _rms(vectors: Array) -> float:
    """Root mean square of the lengths of vectors."""
    return float(np.sqrt(np.square(vectors).sum(axis=1).mean()))
