"""The smoothed velocity of a flight: what all of its IMU and velocity measurements together say, before and after.

It is made of the replay of one set, which only says around what the errors are small; its corrections are taken out
(`inertial_steps`). The receiver's error is white or wanders, as the flight's measurements make most probable.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.metrics.grouping import distinct
from fusetune.analyze.replaying.replayed_set import ReplayedSet, ReplayedSteps
from fusetune.analyze.sensors.measurement_errors import VELOCITY_SOURCES
from fusetune.analyze.smoothing.error_model import USUAL_WALK, ErrorModel, PositionErrors, likeliest_errors
from fusetune.analyze.smoothing.inertial_steps import cross_matrix, inertial_steps, transitions
from fusetune.analyze.smoothing.linear_smoother import Smoothed, measurement_residuals, smooth
from fusetune.analyze.smoothing.measured_positions import MeasuredPositions, position_series
from fusetune.analyze.smoothing.velocity_models import (
    ACCEL,
    DOWN,
    GYRO,
    PLANE,
    Stretch,
    VelocityModel,
    horizontal_model,
    vertical_model,
)
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.px4.flight import Flight
from fusetune.quaternions import rotation_matrix

Array = npt.NDArray[np.float64]

FEWEST_MEASUREMENTS = 30
LONGEST_STRETCH_S = 120.0
"""Biases are constant in a stretch, and all of it is in memory at once."""
LONGEST_STEP_S = 0.1
"""Between updates; beyond it samples of the IMU are missing."""
SEARCHED_STRETCHES = 3
OUTLIER_SIGMAS = 5.0
"""Measurements whose residuals are larger count as if they were as much less exact (Huber)."""
SMALLEST_NOISE = 1e-3
USUAL_POSITION_ERRORS = PositionErrors(white=0.2, walk=0.1)
"""Of GNSS and barometers, from where the search begins."""
NORMAL_QUARTILE = 0.6745
_IN_OTHER_FRAME = 10.0


@dataclass(frozen=True)
class SmoothedVelocity:
    """The reference.

    Attributes
    ----------
    source : of the measurements
    time : (K,) µs, in order
    velocity : (K, 3) NED, m/s
    horizontal, vertical : noises of the measurements as they were found
    plane, heights : sources of positions and heights that were smoothed with it
    """

    source: str
    time: npt.NDArray[np.int64]
    velocity: Array
    horizontal: ErrorModel
    vertical: ErrorModel
    plane: tuple[str, ...] = ()
    heights: tuple[str, ...] = ()

    @property
    def document(self) -> dict[str, Any]:
        """How it was made, as JSON can hold it."""
        found: dict[str, Any] = {"source": self.source}
        for name, errors, sources in (
            ("horizontal", self.horizontal, self.plane),
            ("vertical", self.vertical, self.heights),
        ):
            noises = asdict(errors)
            found[name] = noises | {"positions": dict(zip(sources, noises["positions"], strict=True))}
        return found


def smoothed_velocity(
    record: ReplayedSet, flight: Flight, intervals: Sequence[Interval], step_us: int
) -> SmoothedVelocity | None:
    """Smooth the velocity of a flight.

    Parameters
    ----------
    record : replay of any set
    flight : canonical; `vehicle_gps_position` gives GNSS positions
    intervals : parts of the flight, µs; the reference is known in them where there are measurements
    step_us : from one time of the reference to the next, about

    Returns
    -------
    The reference, or None where no source of velocity was fused, or too little of it
    """
    if record.steps is None or not intervals:
        return None
    of_sources = ((one, measured_velocities(record, one)) for one in VELOCITY_SOURCES)
    source, measured = next((one for one in of_sources if one[1] is not None), ("", None))
    if measured is None:
        return None
    positions = position_series(record, flight, source)
    steps = record.steps()
    rows = stretches_of(steps.time, intervals, record.reset_times["heading"])
    parts = [stretch_of(steps.rows(one), *measured, positions) for one in rows]
    del steps
    return _smoothed(source, [one for one in parts if one is not None], intervals, step_us)


def measured_velocities(record: ReplayedSet, source: str) -> tuple[npt.NDArray[np.int64], Array] | None:
    """Times (N,) and values (N, 3) of a source, as the filter took them, from the first that was fused."""
    if AID_SOURCES[source].axes != 3 or any((source, axis) not in record.samples for axis in range(3)):
        return None
    axes = [record.samples[source, axis] for axis in range(3)]
    time = axes[0].timestamp_sample
    if not axes[0].fused.any() or any(one.observation.size != time.size for one in axes):
        return None
    first = int(np.argmax(axes[0].fused))
    values = np.column_stack([one.observation for one in axes])[first:]
    usable = np.isfinite(values).all(axis=1)
    return time[first:][usable], values[usable]


def stretches_of(
    time: npt.NDArray[np.int64], intervals: Sequence[Interval], resets: npt.NDArray[np.int64]
) -> Iterator[slice]:
    """Rows of the updates from the first to the last interval, parted where the IMU or the heading jumps."""
    first, last = np.searchsorted(time, (intervals[0][0], intervals[-1][1]))
    gaps = np.flatnonzero(np.diff(time[first:last]) > LONGEST_STEP_S * 1e6) + first + 1
    ends = np.unique(np.r_[first, gaps, np.clip(np.searchsorted(time, resets), first, last), last])
    for start, stop in pairwise(ends):
        if stop - start < 2:
            continue
        parts = max(1, int(np.ceil((time[stop - 1] - time[start]) * 1e-6 / LONGEST_STRETCH_S)))
        edges = start + np.arange(parts + 1) * (stop - start) // parts
        yield from (slice(int(one), int(other)) for one, other in pairwise(edges))


def stretch_of(
    steps: ReplayedSteps,
    time: npt.NDArray[np.int64],
    values: Array,
    positions: Sequence[MeasuredPositions],
    swings: bool = False,
) -> Stretch | None:
    """A stretch of the measurements (N, 3) at times (N,), µs; None with too few of them, or in another frame.

    `swings`: with what a lever arm would add to them.
    """
    rows = (time > steps.time[0]) & (time <= steps.time[-1])
    epoch, first = np.unique(np.searchsorted(steps.time, time[rows]), return_index=True)
    if epoch.size < FEWEST_MEASUREMENTS:
        return None
    time, values = time[rows][first], values[rows][first]
    sums = inertial_steps(steps)
    # the measurement is up to one interval older than the update that takes it
    before_s = (sums.time[epoch] - time)[:, None] * 1e-6
    measured = values - (sums.velocity[epoch] - sums.acceleration[epoch] * before_s)
    if not all(np.isfinite(one).all() for one in (sums.known_velocity_time, sums.turned_force, measured)):
        return None
    # an observation in another frame than the state's, such as the body's
    if np.median(np.abs(measured)) > max(_IN_OTHER_FRAME, float(np.median(np.abs(values)))):
        return None
    swing = swing_of(steps, epoch) if swings else None
    return Stretch(sums, epoch, measured, tuple(one.at(sums.time[epoch]) for one in positions), swing)


def swing_of(steps: ReplayedSteps, rows: npt.NDArray[np.int64]) -> Array:
    """R [ω]× (N, 3, 3) at some updates, 1/s: what a lever arm along each axis of the body adds to a velocity, NED."""
    rate = steps.delta_angle[rows] / steps.delta_angle_dt[rows, None] - steps.gyro_bias[rows]
    return np.asarray(rotation_matrix(steps.quaternion[rows]) @ cross_matrix(rate))


def _smoothed(
    source: str, parts: list[Stretch], intervals: Sequence[Interval], step_us: int
) -> SmoothedVelocity | None:
    if not parts:
        return None
    horizontal, courses = fitted([horizontal_model(one) for one in parts])
    vertical, falls = fitted([vertical_model(*one) for one in zip(parts, courses, strict=True)])
    pieces = [_reference(*one, step_us) for one in zip(parts, courses, falls, strict=True)]
    time = np.concatenate([one for one, _ in pieces])
    velocity = np.concatenate([one for _, one in pieces])
    rows = inside(time, intervals)
    if not rows.any():
        return None
    plane, heights = (tuple(one.source for one in parts[0].positions if one.axes == axes) for axes in (PLANE, DOWN))
    return SmoothedVelocity(source, time[rows], velocity[rows], horizontal, vertical, plane, heights)


def fitted(models: Sequence[VelocityModel]) -> tuple[ErrorModel, list[Smoothed]]:
    """The likeliest noises of the stretches together, and the course of each under these."""
    axes = models[0].axes
    change = np.concatenate([np.diff(one.measured[:, :axes], axis=0) for one in models])
    # of the difference of two
    white = max(_spread(change) / math.sqrt(2.0), SMALLEST_NOISE)
    errors = ErrorModel(white, 0.0, 0.0, USUAL_WALK, (USUAL_POSITION_ERRORS,) * models[0].series)
    for one in models:
        model = one(errors)
        found = smooth(model)
        residual = measurement_residuals(model, found.states, found.constants)
        for column in range(residual.shape[1]):
            there = np.isfinite(one.excess[:, column])
            off = np.abs(residual[there, column])
            one.excess[there, column] = np.maximum(1.0, off / (OUTLIER_SIGMAS * max(_spread(off), SMALLEST_NOISE)))
    every = max(1, -(-len(models) // SEARCHED_STRETCHES))
    errors = likeliest_errors(models[::every], errors)
    return errors, [smooth(one(errors)) for one in models]


def _spread(values: Array) -> float:
    """Standard deviation of what is normal among values."""
    return float(np.median(np.abs(values)) / NORMAL_QUARTILE) if values.size else 0.0


def _reference(stretch: Stretch, course: Smoothed, fall: Smoothed, step_us: int) -> tuple[npt.NDArray[np.int64], Array]:
    """The velocity between the first and the last measurement of a stretch.

    From the measurement before by the inertial solution; what that misses at the next one comes in evenly, which is
    the mean of a walk between two known ends.
    """
    sums, epoch = stretch.sums, stretch.epoch
    grid = np.arange(sums.time[epoch[0]], sums.time[epoch[-1]], step_us)
    update = distinct(np.searchsorted(sums.time, grid))
    before = np.clip(np.searchsorted(epoch, update, side="right") - 1, 0, epoch.size - 2)
    velocity = np.column_stack([course.states[:, :2], fall.states[:, 0]])

    def carried(start: npt.NDArray[np.int64], stop: npt.NDArray[np.int64]) -> Array:
        by = transitions(sums, epoch[start], stop)
        error = velocity[start] + by.known_velocity + by.velocity_by_gyro @ course.constants[GYRO]
        error += np.einsum("kij,kj->ki", by.velocity_by_rotation, course.states[start, 2:5])
        error -= by.turned @ course.constants[ACCEL]
        error[:, 2] -= by.passed_s * fall.constants[0]
        return error

    missed = velocity[1:] - carried(np.arange(epoch.size - 1), epoch[1:])
    share = (sums.time[update] - sums.time[epoch[before]]) / (sums.time[epoch[before + 1]] - sums.time[epoch[before]])
    error = carried(before, update) + share[:, None] * missed[before]
    return sums.time[update], sums.velocity[update] + error
