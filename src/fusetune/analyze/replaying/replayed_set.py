"""What a parameter set did on a flight, as scores read it: the same whether it is in memory or in the store."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

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


STATE_BLOCKS = {
    "quaternion": ("states", state.PUBLISHED_QUATERNION, 4),
    "velocity": ("states", state.PUBLISHED_VELOCITY, 3),
    "attitude_variance": ("covariances", state.ATTITUDE, 3),
    "velocity_variance": ("covariances", state.VELOCITY, 3),
    "position_variance": ("covariances", state.POSITION, 3),
}
"""Part of `FilterStates` → the array that it is taken from, the first element and their number."""


def joined_states(pieces: Iterable[Columns]) -> FilterStates:
    """States out of pieces of the rows, each with `time` and the arrays of `STATE_BLOCKS`."""
    parts: dict[str, list[npt.NDArray]] = {
        "time": [np.zeros(0, np.int64)],
        **{name: [np.zeros((0, size))] for name, (_, _, size) in STATE_BLOCKS.items()},
    }
    for piece in pieces:
        for name, values in piece.items():
            parts[name].append(values.astype(np.int64 if name == "time" else np.float64))
    # one after the other, so that no two are in memory in both forms
    return FilterStates(**{name: np.concatenate(parts.pop(name)) for name in (*parts,)})


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
            # The counter is a byte that wraps in the log.
            counts: npt.NDArray[np.int64] = values.astype(np.int64)
            steps = np.subtract(counts[1:], counts[:-1]) & 0xFF
            times[kind] = np.repeat(time[1:], steps)
        return times


def values_of(summary: Mapping[str, Any], part: str) -> dict[str, float]:
    """Parameters in a summary: its `params`, which are all, or its `overrides`."""
    return {name: float(value) for name, value in summary.get(part, {}).items()}
