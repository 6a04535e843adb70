"""Errors of a replay against a reference, on the scored part of the flight."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.reference_truth import EARTH_RADIUS_M, Truth, read_references, read_truth
from fusetune.analyze.metrics.attitude import error_in_ned as attitude_error
from fusetune.analyze.metrics.attitude import heading, interpolate, interpolate_quaternion, wrap
from fusetune.analyze.metrics.error_figures import (
    ErrorFigure,
    Track,
    TrueAttitude,
    attitude_figures,
    nees_figures,
    track_of,
    true_attitude,
    vector_figures,
)
from fusetune.analyze.replaying.replayed_set import FilterStates, ReplayedSet
from fusetune.analyze.scoring.window import ScoringWindow
from fusetune.quaternions import multiply, rotation_matrix

__all__ = [
    "EARTH_RADIUS_M",
    "ErrorFigure",
    "Truth",
    "attitude_figures",
    "interpolate",
    "interpolate_quaternion",
    "read_references",
    "read_truth",
    "true_errors",
    "vector_figures",
]

Array = npt.NDArray[np.float64]


MOST_KEPT_TIMES = 100_000
"""Some ten minutes of flight."""

Made = TypeVar("Made")


class Reference:
    """A reference, and what follows from it at the times at which sets are compared with it.

    Sets that are updated alike have the same times, so what was made for one is kept for the next.
    """

    def __init__(self, truth: Truth) -> None:
        self.truth = truth
        self._kept: dict[str, tuple[npt.NDArray[np.int64], Any]] = {}

    def at(self, time: npt.NDArray[np.int64], what: str, make: Callable[[], Made]) -> Made:
        """What is made of the reference at times (N,), µs."""
        kept = self._kept.get(what)
        if kept is not None and np.array_equal(kept[0], time):
            made: Made = kept[1]
            return made
        made = make()
        if time.size <= MOST_KEPT_TIMES:
            self._kept[what] = time, made
        return made


@dataclass(frozen=True)
class _Outputs:
    """Published position and velocity of a replay, (N, 3), at the times at which they hold, µs."""

    time: npt.NDArray[np.int64]
    position: Array
    velocity: Array


class _TrueMotion(NamedTuple):
    """Position, velocity (N, 3) and track of a reference."""

    position: Array
    velocity: Array
    track: Track


def true_errors(
    record: ReplayedSet, states: FilterStates, reference: Reference, window: ScoringWindow, confidence: float
) -> list[ErrorFigure]:
    """All figures of one replay against one reference.

    Parameters
    ----------
    states : of the same replay
    window : only these times count, alike for all sets

    Returns
    -------
    Position (m; absolute where both origins are known, and with the mean removed), velocity (m/s), attitude (deg:
    tilt, heading, total rotation), and NEES of velocity, of the horizontal position with its mean offset removed, and
    of the attitude. Quantities that the reference does not know are missing.
    """
    if reference.truth.own_north:
        reference = Reference(_turned_north(reference.truth, states, window))
    # one after the other, so that no two are in memory with what they are made of
    return [
        *_position_figures(record, states, _outputs(record, states, reference, window), reference, confidence),
        *_velocity_figures(states, reference, window, confidence),
        *_attitude_figures(states, reference, window, confidence),
    ]


def _outputs(record: ReplayedSet, states: FilterStates, reference: Reference, window: ScoringWindow) -> _Outputs:
    local, truth = record.local_position, reference.truth
    # The output predictor carries the state from the fusion horizon to `timestamp`; that is when it holds.
    time = local["timestamp"].astype(np.int64)
    rows = reference.at(time, "outputs", lambda: np.flatnonzero(window.contains(time) & truth.known_at(time)))
    position, velocity = (
        np.column_stack([local[name][rows] for name in names]).astype(np.float64)
        for names in (("x", "y", "z"), ("vx", "vy", "vz"))
    )
    scored = time[rows]
    if any(truth.lever_arm) and scored.size > 1:
        arm = _arm(states, truth, scored)
        position = position + arm
        velocity = velocity + np.gradient(arm, scored * 1e-6, axis=0)
    return _Outputs(scored, position, velocity)


def _arm(states: FilterStates, truth: Truth, at: npt.NDArray[np.int64]) -> Array:
    """Lever arm in NED, m, (N, 3): its derivative is the velocity that turning adds."""
    attitude = interpolate_quaternion(states.time, states.quaternion, at)
    return rotation_matrix(attitude) @ np.array(truth.lever_arm)


def _position_figures(
    record: ReplayedSet, states: FilterStates, outputs: _Outputs, reference: Reference, confidence: float
) -> list[ErrorFigure]:
    time, position, velocity = outputs.time, outputs.position, outputs.velocity
    # of an hour's flight each of these is 10 MB: what has served goes
    del outputs
    figures: list[ErrorFigure] = []
    if time.size < 2:
        return figures
    truth = reference.truth
    true = reference.at(time, "motion", lambda: _true_motion(truth, time))
    if truth.velocity.size:
        figures += vector_figures("velocity", velocity - true.velocity, true.track)
    del velocity
    error = position - true.position
    del position
    track = true.track
    del true
    offset = _origin_offset(record, truth)
    if offset is not None:
        figures += vector_figures("position", error + offset, track)
    centred = error - error.mean(axis=0)
    del error
    figures += vector_figures("position_mean_removed", centred, track)
    del track
    # The variance is that of the fusion horizon, some 0.1 s earlier, over which it hardly changes.
    variance = interpolate(states.time, states.position_variance[:, :2], time)
    return figures + nees_figures(
        "position_mean_removed", "horizontal", time, centred[:, :2], variance, confidence, fitted=2
    )


def _true_motion(truth: Truth, time: npt.NDArray[np.int64]) -> _TrueMotion:
    known = truth.velocity if truth.velocity.size else np.gradient(truth.position, truth.time * 1e-6, axis=0)
    velocity = interpolate(truth.time, known, time)
    return _TrueMotion(interpolate(truth.time, truth.position, time), velocity, track_of(velocity))


def _origin_offset(record: ReplayedSet, truth: Truth) -> Array | None:
    origin = record.summary.get("origin")
    if not origin or truth.reference is None:
        return None
    latitude, longitude, altitude = truth.reference
    north = np.radians(origin["latitude_deg"] - latitude) * EARTH_RADIUS_M
    east = np.radians(origin["longitude_deg"] - longitude) * EARTH_RADIUS_M * np.cos(np.radians(latitude))
    return np.array([north, east, altitude - origin["altitude_m"]])


def _velocity_figures(
    states: FilterStates, reference: Reference, window: ScoringWindow, confidence: float
) -> list[ErrorFigure]:
    truth = reference.truth
    if not truth.velocity.size:
        return []

    def known() -> tuple[npt.NDArray[np.int64], Array]:
        rows = np.flatnonzero(window.contains(states.time) & truth.known_at(states.time))
        return rows, interpolate(truth.time, truth.velocity, states.time[rows])

    rows, true_velocity = reference.at(states.time, "velocity", known)
    if rows.size < 2:
        return []
    time, velocity = states.time[rows], states.velocity[rows]
    if any(truth.lever_arm):
        velocity = velocity + np.gradient(_arm(states, truth, time), time * 1e-6, axis=0)
    return nees_figures("velocity", "all", time, velocity - true_velocity, states.velocity_variance[rows], confidence)


def _attitude_figures(
    states: FilterStates, reference: Reference, window: ScoringWindow, confidence: float
) -> list[ErrorFigure]:
    truth = reference.truth

    def known() -> tuple[npt.NDArray[np.int64], TrueAttitude | None]:
        rows = np.flatnonzero(window.contains(states.time) & truth.known_at(states.time, attitude=True))
        if rows.size < 2:
            return rows, None
        time = states.time[rows]
        return rows, true_attitude(interpolate_quaternion(truth.attitude_time, truth.quaternion, time))

    rows, true = reference.at(states.time, "attitude", known)
    if true is None:
        return []
    attitude = states.quaternion[rows]
    figures = attitude_figures(attitude, true)
    error = attitude_error(attitude, true.quaternion)
    del attitude, true
    return figures + nees_figures(
        "attitude", "all", states.time[rows], error, states.attitude_variance[rows], confidence
    )


def _turned_north(truth: Truth, states: FilterStates, window: ScoringWindow) -> Truth:
    """The reference turned about the vertical by the mean heading between it and the estimate.

    Where it has no attitude, by the angle that brings its horizontal path nearest to the integrated velocity.
    """
    if truth.attitude_time.size:
        rows = window.contains(states.time) & truth.known_at(states.time, attitude=True)
        if not rows.any():
            return truth
        own = interpolate_quaternion(truth.attitude_time, truth.quaternion, states.time[rows])
        off = wrap(heading(states.quaternion[rows]) - heading(own))
        angle = float(np.angle(np.mean(np.exp(1j * off))))
    else:
        rows = window.contains(truth.time) & (truth.time >= states.time[0]) & (truth.time <= states.time[-1])
        if np.count_nonzero(rows) < 3:
            return truth
        own_speed = np.gradient(truth.position[:, :2], truth.time * 1e-6, axis=0)[rows] @ np.array([1.0, 1j])
        speed = interpolate(states.time, states.velocity[:, :2], truth.time[rows]) @ np.array([1.0, 1j])
        angle = float(np.angle(np.sum(speed * np.conj(own_speed))))
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    half = np.array([[np.cos(angle / 2.0), 0.0, 0.0, np.sin(angle / 2.0)]])
    return replace(
        truth,
        position=truth.position @ turn.T,
        velocity=truth.velocity @ turn.T,
        quaternion=multiply(np.broadcast_to(half, truth.quaternion.shape), truth.quaternion),
    )
