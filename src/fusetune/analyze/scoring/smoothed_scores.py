"""How far the velocity of each set is from the smoothed one, summed over blocks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.metrics.attitude import interpolate
from fusetune.analyze.metrics.likelihood import winsor_limit
from fusetune.analyze.replaying.replayed_set import FilterStates
from fusetune.analyze.scoring.columns import (
    FLIGHT_AND_SET,
    SOURCE_AND_AXIS,
    columns_of,
    parted,
    repeated,
    texts_repeated,
)
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


def velocity_differences(reference: SmoothedVelocity, states: FilterStates) -> npt.NDArray[np.float64]:
    """Velocity of a set less the smoothed one, (K, 3) NED, at the times of the reference; in single precision."""
    velocity = interpolate(states.time, states.velocity, reference.time)
    return (velocity - reference.velocity).astype(np.float32).astype(np.float64)


@dataclass(frozen=True, eq=False)
class SmoothedMask:
    """What all sets of a flight are compared with: the smoothed velocity, and how far the present set is from it.

    Attributes
    ----------
    present : (K, 3) `velocity_differences` of the present set
    """

    reference: SmoothedVelocity
    present: npt.NDArray[np.float64]

    @cached_property
    def winsor_limits(self) -> npt.NDArray[np.float64]:
        """(3,) see `fusetune.analyze.metrics.likelihood.winsor_limit`; of the present set alone."""
        return np.array([winsor_limit(column.copy()) for column in self.present.T])


def smoothed_rows(
    flight: str,
    differences: Mapping[str, npt.NDArray[np.float64]],
    mask: SmoothedMask,
    edges: npt.NDArray[np.int64],
) -> Iterator[pa.Table]:
    """Rows of `SMOOTHED_SCHEMA` of each set.

    Parameters
    ----------
    differences : (K, 3) `velocity_differences` of each set, by name
    edges : of the blocks, µs
    """
    time, source = mask.reference.time, mask.reference.source
    block = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, edges.size - 2)
    starts = np.flatnonzero(np.r_[True, (np.diff(block) != 0) | (np.diff(time // _TOGETHER_US) != 0)])
    counts = np.diff(np.r_[starts, block.size])
    sets, axes = len(differences), mask.present.shape[1]
    of_set = axes * starts.size
    limits = np.tile(mask.winsor_limits, sets)[:, None]
    values = np.concatenate([one.T for one in differences.values()])
    table = pa.table(
        {
            "flight": repeated(flight, sets * of_set),
            "set": texts_repeated([*differences], np.full(sets, of_set)),
            "source": repeated(source, sets * of_set),
            "axis": pa.array(np.tile(np.repeat(np.arange(axes, dtype=np.int32), starts.size), sets)),
            "block": pa.array(np.tile(block[starts].astype(np.int32), sets * axes)),
            "start_us": pa.array(np.tile(time[starts], sets * axes)),
            "stop_us": pa.array(np.tile(time[starts + counts - 1], sets * axes)),
            "n": pa.array(np.tile(counts.astype(np.int64), sets * axes)),
            "sum_squares": pa.array(_sums(values, starts)),
            "sum_squares_winsorised": pa.array(_sums(np.clip(values, -limits, limits), starts)),
        },
        schema=SMOOTHED_SCHEMA,
    )
    return parted(table, [of_set] * sets)


def _sums(values: npt.NDArray[np.float64], starts: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """Sums of squares of (A, K) values over the blocks that begin at `starts`, axis by axis."""
    return np.asarray(np.add.reduceat(np.square(values), starts, axis=1).ravel())
