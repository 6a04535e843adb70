"""Sums over blocks of about 10 s: all that the decision needs, additive so that blocks can be redrawn."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import repeat

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.metrics.consistency import nis_of_axes
from fusetune.analyze.metrics.innovation_metrics import squares
from fusetune.analyze.metrics.likelihood import clipped_nis, gaussian_terms, log_variance, student_t_terms
from fusetune.analyze.scoring.columns import (
    FLIGHT_AND_SET,
    SOURCE_AND_AXIS,
    columns_of,
    parted,
    repeated,
    texts_repeated,
)
from fusetune.analyze.scoring.measurement_alignment import AxesTogether
from fusetune.analyze.scoring.parts import Parts, parts_of

BLOCK_SCHEMA = pa.schema(
    [
        *FLIGHT_AND_SET,
        *SOURCE_AND_AXIS,
        pa.field("block", pa.int32()),
        pa.field("n", pa.int64()),
        *columns_of(pa.float64(), "sum_squared_innovation", "sum_nis", "sum_nis_winsorised", "sum_log_variance"),
        *columns_of(pa.float64(), "sum_nll", "sum_nll_student_t"),
    ]
)
"""One row per set, source, axis and block; `n` is the same for all sets of a flight."""


_SCORES = {
    "sum_squared_innovation": squares,
    "sum_nis": nis_of_axes,
    "sum_nis_winsorised": clipped_nis,
    "sum_log_variance": log_variance,
    "sum_nll": gaussian_terms,
    "sum_nll_student_t": student_t_terms,
}
"""Of each axis and sample."""


@dataclass(frozen=True, eq=False)
class BlockSums:
    """Sums over the blocks that hold samples, of axes of one source.

    Attributes
    ----------
    values : by name of the score, (A, B)
    """

    source: str
    axes: tuple[int, ...]
    parts: Parts
    values: dict[str, npt.NDArray[np.float64]]

    @property
    def rows(self) -> int:
        return len(self.axes) * self.parts.starts.size


def block_sums(samples: AxesTogether, edges: npt.NDArray[np.int64]) -> list[BlockSums]:
    """Sum the scores of the axes of one source over blocks, of each set.

    Parameters
    ----------
    edges : (B + 1,) edges of the blocks, µs; blocks without samples have no sum
    """
    parts, axes = parts_of(samples.time, edges), tuple(samples.axes)
    given = samples.innovations
    sums = {name: np.add.reduceat(given.by_axis(score)[0], parts.starts, axis=1) for name, score in _SCORES.items()}
    places = [slice(first, first + len(axes)) for first in range(0, len(samples.samples), len(axes))]
    return [
        BlockSums(samples.source, axes, parts, {name: values[place] for name, values in sums.items()})
        for place in places
    ]


def block_rows(flight: str, of_sets: Mapping[str, Sequence[BlockSums]]) -> Iterator[pa.Table]:
    """Rows of `BLOCK_SCHEMA` of each set."""
    sums = [one for found in of_sets.values() for one in found]
    if not sums:
        return repeat(BLOCK_SCHEMA.empty_table(), len(of_sets))
    rows = np.array([one.rows for one in sums])
    sets = [name for name, found in of_sets.items() for _ in found]
    axes = [np.repeat(np.array(one.axes, np.int32), one.parts.starts.size) for one in sums]
    columns: dict[str, pa.Array] = {
        "flight": repeated(flight, int(rows.sum())),
        "set": texts_repeated(sets, rows),
        "source": texts_repeated([one.source for one in sums], rows),
        "axis": pa.array(np.concatenate(axes)),
        "block": pa.array(np.concatenate([np.tile(one.parts.number.astype(np.int32), len(one.axes)) for one in sums])),
        "n": pa.array(np.concatenate([np.tile(one.parts.counts.astype(np.int64), len(one.axes)) for one in sums])),
    }
    for name in sums[0].values:
        columns[name] = pa.array(np.concatenate([one.values[name].ravel() for one in sums]))
    table = pa.table(columns, schema=BLOCK_SCHEMA)
    return parted(table, [sum(one.rows for one in found) for found in of_sets.values()])
