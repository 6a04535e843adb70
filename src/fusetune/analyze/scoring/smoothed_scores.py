"""How far the velocity of each set is from the smoothed one, summed over blocks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.metrics.attitude import interpolate
from fusetune.analyze.metrics.likelihood import winsor_limit, winsorised
from fusetune.analyze.replaying.replayed_set import FilterStates
from fusetune.analyze.scoring.columns import FLIGHT_AND_SET, SOURCE_AND_AXIS, columns_of
from fusetune.analyze.smoothing.smoothed_velocity import SmoothedVelocity

SMOOTHED_SCHEMA = pa.schema(
    [
        *FLIGHT_AND_SET,
        *SOURCE_AND_AXIS,
        pa.field("block", pa.int32()),
        *columns_of(pa.int64(), "start_us", "stop_us"),
        pa.field("n", pa.int64()),
        *columns_of(pa.float64(), "sum_squares", "sum_squares_winsorised"),
    ]
)
"""One row per set, axis (north, east, down), block and about a second in it: sums of squared differences of velocity,
m²/s², at `n` times from `start_us` to `stop_us`.

These are the same for all sets; `source` is the one that the reference was made of."""

STEP_US = 50_000
_TOGETHER_US = 1_000_000


class SmoothedScores:
    """Takes the states of one set after the other."""

    def __init__(self, reference: SmoothedVelocity | None) -> None:
        self._reference = reference
        self._sets: list[str] = []
        self._differences: list[npt.NDArray[np.float32]] = []

    def add(self, name: str, states: FilterStates) -> None:
        """Compare the velocity of a set, (N, 3) on the fusion horizon."""
        if self._reference is not None:
            velocity = interpolate(states.time, states.velocity, self._reference.time)
            self._sets.append(name)
            self._differences.append((velocity - self._reference.velocity).astype(np.float32))

    def rows(self, flight: str, edges: npt.NDArray[np.int64]) -> pa.Table:
        """Rows of `SMOOTHED_SCHEMA`; none where there is no reference."""
        if self._reference is None or not self._sets:
            return SMOOTHED_SCHEMA.empty_table()
        time = self._reference.time
        block = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, edges.size - 2)
        starts = np.flatnonzero(np.r_[True, (np.diff(block) != 0) | (np.diff(time // _TOGETHER_US) != 0)])
        counts = np.diff(np.r_[starts, block.size])
        tables = [self._axis_rows(flight, axis, block[starts], starts, counts) for axis in range(3)]
        return pa.concat_tables(tables)

    def _axis_rows(
        self,
        flight: str,
        axis: int,
        blocks: npt.NDArray[np.int64],
        starts: npt.NDArray[np.int64],
        counts: npt.NDArray[np.int64],
    ) -> pa.Table:
        assert self._reference is not None
        difference = np.stack([one[:, axis] for one in self._differences]).astype(np.float64)
        clipped = winsorised(difference, winsor_limit(difference.copy()))
        sets, rows = len(self._sets), len(self._sets) * starts.size
        columns = {
            "flight": pa.array([flight] * rows, pa.string()),
            "set": pa.array(np.repeat(np.array(self._sets, dtype=object), starts.size), pa.string()),
            "source": pa.array([self._reference.source] * rows, pa.string()),
            "axis": pa.array(np.full(rows, axis, np.int32)),
            "block": pa.array(np.tile(blocks.astype(np.int32), sets)),
            "start_us": pa.array(np.tile(self._reference.time[starts], sets)),
            "stop_us": pa.array(np.tile(self._reference.time[starts + counts - 1], sets)),
            "n": pa.array(np.tile(counts.astype(np.int64), sets)),
            "sum_squares": pa.array(_sums(difference, starts)),
            "sum_squares_winsorised": pa.array(_sums(clipped, starts)),
        }
        return pa.table(columns, schema=SMOOTHED_SCHEMA)


def _sums(values: npt.NDArray[np.float64], starts: Sequence[int] | npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """Sums of squares of (S, K) values over the blocks that begin at `starts`, set by set."""
    return np.asarray(np.add.reduceat(np.square(values), starts, axis=1).ravel())
