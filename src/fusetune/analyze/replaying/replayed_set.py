"""What a parameter set did on a flight, as scores read it: the same whether it is in memory or in the store."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.ekf2.filter.common import state

Array = npt.NDArray[np.float64]
Columns = Mapping[str, npt.NDArray[Any]]

RESET_COUNTERS = {
    "horizontal_position": "xy_reset_counter",
    "height": "z_reset_counter",
    "horizontal_velocity": "vxy_reset_counter",
    "vertical_velocity": "vz_reset_counter",
    "heading": "heading_reset_counter",
}


@dataclass(frozen=True)
class FilterStates:
    """States and variances after each update, on the fusion time horizon; N rows in order of time.

    Attributes
    ----------
    time : (N,) time on the fusion horizon, µs
    quaternion : (N, 4) w, x, y, z; body → NED
    velocity : (N, 3) NED, m/s
    attitude_variance : (N, 3) of the rotation vector in NED, rad²
    velocity_variance, position_variance : (N, 3) NED, m²/s² and m²
    """

    time: npt.NDArray[np.int64]
    quaternion: Array
    velocity: Array
    attitude_variance: Array
    velocity_variance: Array
    position_variance: Array


@dataclass(frozen=True)
class ReplayedSteps:
    """The state after each update and the IMU interval that it was predicted over; N rows in order of time.

    Attributes
    ----------
    time : (N,) time on the fusion horizon, µs
    quaternion, velocity : as in `FilterStates`
    gyro_bias, accel_bias : (N, 3) body, rad/s and m/s²
    delta_angle, delta_velocity : (N, 3) of the down-sampled IMU, body, rad and m/s
    delta_angle_dt, delta_velocity_dt : (N,) over which they were integrated, s
    """

    time: npt.NDArray[np.int64]
    quaternion: Array
    velocity: Array
    gyro_bias: Array
    accel_bias: Array
    delta_angle: Array
    delta_angle_dt: Array
    delta_velocity: Array
    delta_velocity_dt: Array

    def rows(self, selected: slice) -> ReplayedSteps:
        """Some of the rows."""
        return ReplayedSteps(**{one.name: getattr(self, one.name)[selected] for one in fields(self)})


class Block(NamedTuple):
    """Part of a row of states: the field of the row, and of a field of several elements the first one and their number.

    `size` is 0 where the field is a single figure.
    """

    field: str
    first: int = 0
    size: int = 0

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its columns in the table of states."""
        if not self.size:
            return (self.field,)
        return tuple(f"{self.field}_{self.first + i}" for i in range(self.size))

    def of_rows(self, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """A copy of it out of the rows of a replay."""
        values = rows[self.field]
        return np.array(values[:, self.first : self.first + self.size] if self.size else values)

    def of_columns(self, columns: Columns) -> npt.NDArray[Any]:
        """It out of the columns of the table of states."""
        return np.column_stack([columns[name] for name in self.columns]) if self.size else columns[self.field]


STATE_BLOCKS = {
    "quaternion": Block("states", state.PUBLISHED_QUATERNION, 4),
    "velocity": Block("states", state.PUBLISHED_VELOCITY, 3),
    "attitude_variance": Block("covariances", state.ATTITUDE, 3),
    "velocity_variance": Block("covariances", state.VELOCITY, 3),
    "position_variance": Block("covariances", state.POSITION, 3),
}
"""Where the parts of `FilterStates` are taken from."""

STEP_BLOCKS = {
    "quaternion": STATE_BLOCKS["quaternion"],
    "velocity": STATE_BLOCKS["velocity"],
    "gyro_bias": Block("states", state.PUBLISHED_GYRO_BIAS, 3),
    "accel_bias": Block("states", state.PUBLISHED_ACCEL_BIAS, 3),
    "delta_angle": Block("delta_angle", 0, 3),
    "delta_angle_dt": Block("delta_angle_dt"),
    "delta_velocity": Block("delta_velocity", 0, 3),
    "delta_velocity_dt": Block("delta_velocity_dt"),
}
"""Where the parts of `ReplayedSteps` are taken from."""


def joined_states(pieces: Iterable[Columns]) -> FilterStates:
    """States out of pieces of the rows, each with `time` and at least the arrays of `STATE_BLOCKS`."""
    return FilterStates(**_joined(pieces, STATE_BLOCKS))


def joined_steps(pieces: Iterable[Columns]) -> ReplayedSteps:
    """Steps out of pieces of the rows, each with `time` and at least the arrays of `STEP_BLOCKS`."""
    return ReplayedSteps(**_joined(pieces, STEP_BLOCKS))


def _joined(pieces: Iterable[Columns], blocks: Mapping[str, Block]) -> dict[str, npt.NDArray[Any]]:
    shapes = {"time": (), **{name: (block.size,) if block.size else () for name, block in blocks.items()}}
    found = {name: np.zeros((0, *shape), np.int64 if name == "time" else np.float64) for name, shape in shapes.items()}
    count = 0
    for piece in pieces:
        rows = slice(count, count := count + piece["time"].size)
        for name, values in found.items():
            if count > len(values):
                # twice what is needed: room that is not used takes no memory, and nothing small is left behind
                found[name] = np.empty((2 * count, *shapes[name]), values.dtype)
                found[name][: rows.start] = values[: rows.start]
            found[name][rows] = piece[name]
    return {name: values[:count] for name, values in found.items()}


@dataclass(frozen=True)
class ReplayedSet:
    """One parameter set's replay of one flight.

    Attributes
    ----------
    summary : how it went, see `fusetune.analyze.replaying.replay_summary`
    samples : look up one source and axis at a time: each may be read from the disk
    flags : status flags at their changes, with their `timestamp`
    local_position : the same goes for these columns as for the samples
    states : fetches the states at every update
    steps : fetches these with the IMU; None of replays from elsewhere, which do not have it
    withheld : fetches what was predicted in gaps; None of replays from elsewhere, which have none
    gaps : fetches position and velocity at the ends of the gaps
    """

    name: str
    parameters: dict[str, float]
    overrides: dict[str, float]
    summary: dict[str, Any]
    samples: Mapping[SourceAxis, AxisSamples]
    flags: Columns
    local_position: Columns
    states: Callable[[], FilterStates] = lambda: joined_states(())
    steps: Callable[[], ReplayedSteps] | None = None
    withheld: Callable[[], Columns] | None = None
    gaps: Callable[[], Columns] | None = None

    @property
    def status(self) -> str:
        return str(self.summary.get("status", "ok"))

    @property
    def is_warm_started(self) -> bool:
        """Whether the replay started from the vehicle's own state."""
        return bool(self.summary.get("start", {}).get("mode") == "warm")

    @cached_property
    def first_fused(self) -> dict[SourceAxis, int]:
        """Time, µs, of the first sample that was fused, of each source and axis of which one was."""
        first = {}
        for key in self.samples:
            samples = self.samples[key]
            if samples.fused.any():
                first[key] = int(samples.timestamp_sample[np.argmax(samples.fused)])
        return first

    @property
    def fused_sources(self) -> set[str]:
        """Sources that were fused at least once."""
        return {source for source, _ in self.first_fused}

    @cached_property
    def reset_times(self) -> dict[str, npt.NDArray[np.int64]]:
        """Times at which each reset counter moved, µs; one entry for every step of the counter."""
        time = self.local_position.get("timestamp", np.zeros(0, dtype=np.int64)).astype(np.int64)
        times = {}
        for kind, counter in RESET_COUNTERS.items():
            values = self.local_position.get(counter)
            if values is None or values.size < 2:
                times[kind] = np.zeros(0, dtype=np.int64)
                continue
            times[kind] = counter_steps(time, values)
        return times


def counter_steps(time: npt.NDArray[np.int64], counter: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Times at which a reset counter moved, one entry for every step: it is a byte that wraps in the log.

    Parameters
    ----------
    time, counter : (N,) µs, and the counter as logged
    """
    counts: npt.NDArray[np.int64] = counter.astype(np.int64)
    return np.repeat(time[1:].astype(np.int64), np.subtract(counts[1:], counts[:-1]) & 0xFF)


def values_of(summary: Mapping[str, Any], part: str) -> dict[str, float]:
    """Parameters in a summary: its `params`, which are all, or its `overrides`."""
    return {name: float(value) for name, value in summary.get(part, {}).items()}
