"""GNSS velocity against what the IMU integrates: delay, lever arm and heading, found together.

A measured velocity differs from the inertial one by what the receiver's delay, the antenna's place, a wrong heading,
the tilt and the accelerometer's bias make of it. All are linear in what is unknown, up to the delay and the heading,
which are looked for in rounds; what is left wanders, and the regression knows that (`whitened_regression`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.diagnosis.lagged_regression import LaggedFit, about_down, lagged_fit, turned_by
from fusetune.analyze.diagnosis.motion import Motion
from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.metrics.grouping import distinct, rows_of
from fusetune.px4.flight import TopicTable

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

FIX_3D = 3
_HEADING_OVER_S = 1.0
_RATE_OVER_US = 50_000


@dataclass(frozen=True)
class GnssMotion:
    """What the velocity of a receiver tells beside the velocity.

    Attributes
    ----------
    fit : delay and its like
    arm, arm_error : (3,) antenna from the IMU, FRD, m
    heading, heading_error : turns the gyros' frame to NED, rad
    bias_down, bias_down_error : of the accelerometer in the air, down the body, m/s²: what the vertical velocity
        grows by against that of GNSS
    """

    fit: LaggedFit
    arm: Array
    arm_error: Array
    heading: float
    heading_error: float
    bias_down: float
    bias_down_error: float


def gnss_velocities(table: TopicTable | None) -> tuple[Times, Array] | None:
    """Times (N,) of receipt, µs, and velocities (N, 3), NED, m/s, of the samples with a fix."""
    if table is None or "vel_n_m_s" not in table or "fix_type" not in table:
        return None
    time = table["timestamp"].astype(np.int64)
    velocity = np.column_stack([table[f"vel_{axis}_m_s"].astype(np.float64) for axis in "ned"])
    good = np.isfinite(velocity).all(axis=1) & (table["fix_type"] >= FIX_3D)
    if "vel_ned_valid" in table:
        good &= table["vel_ned_valid"].astype(bool)
    good[1:] &= np.diff(time) > 0
    return time[good], velocity[good]


def gnss_motion(
    table: TopicTable | None, motion: Motion, intervals: tuple[Interval, ...], parameters: Mapping[str, float]
) -> GnssMotion | None:
    """The regression over some intervals, µs; None where there is too little of it, or it does not end."""
    found = gnss_velocities(table)
    if found is None:
        return None
    time, measured = found
    usable = inside(time, intervals) & (time > motion.time[0]) & (time < motion.time[-1])
    time, measured = time[usable], measured[usable]
    if time.size < 2:
        return None
    apart = max(1, round(_HEADING_OVER_S / max(float(np.median(np.diff(time))) * 1e-6, 0.01)))
    swept, biased, heading = motion.swept, _biased(motion), 0.0

    def course(at: Times) -> tuple[Array, Array]:
        nonlocal heading
        free = motion.at(at, motion.free_velocity)
        heading = turned_by(free, measured, apart)
        turn = about_down(heading)
        before, after = (motion.at(at + side, motion.free_velocity) for side in (-_RATE_OVER_US, _RATE_OVER_US))
        later = (before - after) @ turn.T / (2e-6 * _RATE_OVER_US)
        free = free @ turn.T
        across = np.column_stack([-free[:, 1], free[:, 0], np.zeros(at.size)])
        # a tilt pushes north and east; down it is the accelerometer's own bias
        pushed = np.zeros((at.size, 3, 2))
        pushed[:, range(2), range(2)] = ((at - at[0]) * 1e-6)[:, None]
        columns = [later[:, :, None], across[:, :, None], turn @ motion.at(at, swept), turn @ motion.at(at, biased)]
        return free, np.concatenate([*columns, pushed], axis=2)

    fit = lagged_fit(time, measured, course, parameters.get("EKF2_GPS_DELAY", 110.0) * 1e-3)
    if fit is None:
        return None
    angle = heading + float(fit.values[0])
    return GnssMotion(
        fit,
        fit.values[1:4],
        fit.errors[1:4],
        float(np.arctan2(np.sin(angle), np.cos(angle))),
        float(fit.errors[0]),
        *_bias_down(time - round(fit.delay_s * 1e6), measured, motion),
    )


def _bias_down(at: Times, measured: Array, motion: Motion) -> tuple[float, float]:
    """Growth of the inertial vertical velocity against the measured one, and how unlike it is in pieces of the
    flight."""
    gained = motion.at(at, motion.free_velocity)[:, 2] - measured[:, 2]
    since_s = (at - at[0]) * 1e-6
    whole = float(np.polyfit(since_s, gained, 1)[0])
    piece = (since_s / PIECE_S).astype(np.int64)
    slopes = [
        float(np.polyfit(since_s[own], gained[own], 1)[0])
        for own in rows_of(piece, distinct(piece))
        if own.size >= FEWEST_IN_PIECE
    ]
    return whole, float(np.std(slopes) / np.sqrt(len(slopes))) if len(slopes) > 1 else float("inf")


PIECE_S, FEWEST_IN_PIECE = 8.0, 10


def _biased(motion: Motion) -> Array:
    """(N, 3, 3) velocity that a bias of 1 m/s² along each axis of the body makes."""
    step_s = np.diff(motion.time, prepend=motion.time[:1]) * 1e-6
    return np.asarray(np.cumsum(motion.rotation * step_s[:, None, None], axis=0))
