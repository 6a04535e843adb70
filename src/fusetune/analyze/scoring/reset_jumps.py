"""How far each reset moved the published state: a reset is as grave as its jump.

The replay records counters, not the deltas that PX4 publishes beside them. These follow from what is published at every
update: the step over the update at which a counter moves, less what the motion of the updates before explains (for a
position the velocity, for a velocity or a heading the step before). At some 100 updates per second what is left of the
motion is a few hundredths of m/s.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.metrics.attitude import wrap
from fusetune.analyze.replaying.replayed_set import RESET_COUNTERS, Columns, ReplayedSet

Array = npt.NDArray[np.float64]


class _Kind(NamedTuple):
    """What a kind of reset moves: columns of the published position, the columns of their rates where these are
    published, the unit of the jump, and from which size on it is significant."""

    columns: tuple[str, ...]
    rates: tuple[str, ...]
    unit: str
    significant: float


_KINDS: Mapping[str, _Kind] = {
    "horizontal_position": _Kind(("x", "y"), ("vx", "vy"), "m", 1.0),
    "height": _Kind(("z",), ("vz",), "m", 1.0),
    "horizontal_velocity": _Kind(("vx", "vy"), (), "m/s", 0.5),
    "vertical_velocity": _Kind(("vz",), (), "m/s", 0.5),
    "heading": _Kind(("heading",), (), "deg", 5.0),
}
"""A jump is significant beyond about twice what PX4's defaults take for the error of one GNSS measurement (0.5 m, 0.3
m/s); smaller ones are no larger than what a fused measurement may do. A heading of 5° off turns 1 m/s² of acceleration
into 0.5 m/s of wrong velocity in 6 s. By kind, as in `RESET_COUNTERS`."""

FAR = " or ".join(dict.fromkeys(f"{kind.significant:g} {kind.unit}" for kind in _KINDS.values()))
"""How far a significant jump goes, in words."""


@dataclass(frozen=True)
class Jumps:
    """Updates at which a counter moved: times, µs, and by how much the state did, (N,); NaN where it is not known."""

    time: npt.NDArray[np.int64]
    size: Array

    def inside(self, intervals: Iterable[Interval]) -> Jumps:
        rows = inside(self.time, intervals)
        return Jumps(self.time[rows], self.size[rows])


@dataclass(frozen=True)
class JumpFigures:
    """Jumps of one kind: the largest, the root mean square, and their unit; None where they are not known."""

    largest: float | None
    rms: float | None
    unit: str


def reset_jumps(record: ReplayedSet) -> dict[str, Jumps]:
    """Jumps of each kind of reset, in order of time."""
    local = record.local_position
    time = local.get("timestamp", np.zeros(0)).astype(np.int64)
    found = {}
    for kind, counter in RESET_COUNTERS.items():
        counts = local.get(counter)
        moved = np.flatnonzero(np.diff(counts)) + 1 if counts is not None else np.zeros(0, np.int64)
        found[kind] = Jumps(time[moved], _sizes(local, _KINDS[kind], time, moved))
    return found


def _sizes(local: Columns, kind: _Kind, time: npt.NDArray[np.int64], at: npt.NDArray[np.int64]) -> Array:
    if any(name not in local for name in (*kind.columns, *kind.rates)):
        return np.full(at.shape, np.nan)
    before = np.maximum(at - 2, 0)
    step_s, former_s = (time[at] - time[at - 1]) * 1e-6, (time[at - 1] - time[before]) * 1e-6
    squares = np.zeros(at.shape)
    for place, name in enumerate(kind.columns):
        values = local[name].astype(np.float64)
        if kind.rates:
            expected = local[kind.rates[place]].astype(np.float64)[at - 1] * step_s
        else:
            share = np.divide(step_s, former_s, out=np.zeros(at.shape), where=former_s > 0.0)
            expected = _step(kind, values[at - 1] - values[before]) * share
        squares += np.square(_step(kind, values[at] - values[at - 1] - expected))
    size = np.sqrt(squares)
    return np.degrees(size) if kind.unit == "deg" else size


def _step(kind: _Kind, step: Array) -> Array:
    return np.asarray(wrap(step) if kind.unit == "deg" else step)


def jump_figures(kind: str, jumps: Jumps) -> JumpFigures:
    """Figures of the jumps of one kind, of which there is one at least."""
    known = jumps.size[np.isfinite(jumps.size)]
    unit = _KINDS[kind].unit
    if not known.size:
        return JumpFigures(None, None, unit)
    return JumpFigures(round(float(known.max()), 4), round(float(np.sqrt(np.mean(np.square(known)))), 4), unit)


def significant(jumps: Mapping[str, Jumps]) -> int:
    """Number of updates at which the state moved far in any way; a jump that is not known counts.

    Position and velocity are often reset together: that is one.
    """
    far = [one.time[~(one.size <= _KINDS[kind].significant)] for kind, one in jumps.items()]
    return int(np.unique(np.concatenate([np.zeros(0, np.int64), *far])).size)
