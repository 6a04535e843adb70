"""Sums over blocks of about 10 s: all that the decision needs, additive so that blocks can be redrawn."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.metrics.likelihood import gaussian_nll, student_t_nll, winsorised
from fusetune.analyze.scoring.columns import FLIGHT_AND_SET, SOURCE_AND_AXIS, columns_of, repeated
from fusetune.analyze.scoring.measurement_alignment import AxesTogether
from fusetune.analyze.scoring.parts import parts_of

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


def block_rows(flight: str, set_name: str, samples: AxesTogether, edges: npt.NDArray[np.int64]) -> pa.Table:
    """Sum the scores of the axes of one source over blocks.

    Parameters
    ----------
    edges : (B + 1,) edges of the blocks, µs; blocks without samples have no row
    """
    parts = parts_of(samples.time, edges)
    axes = len(samples.samples)
    rows = axes * parts.starts.size
    columns: dict[str, pa.Array] = {
        "flight": repeated(flight, rows),
        "set": repeated(set_name, rows),
        "source": repeated(samples.source, rows),
        "axis": pa.array(np.repeat(np.array(samples.axes, np.int32), parts.starts.size)),
        "block": pa.array(np.tile(parts.number.astype(np.int32), axes)),
        "n": pa.array(np.tile(parts.counts.astype(np.int64), axes)),
    }
    for name, scores in _scores(samples):
        columns[name] = pa.array(np.add.reduceat(scores, parts.starts, axis=1).ravel())
    return pa.table(columns, schema=BLOCK_SCHEMA)


def _scores(samples: AxesTogether) -> Iterator[tuple[str, npt.NDArray[np.float64]]]:
    """Of each axis and sample, (A, N); one after the other, for each is as large as the innovations."""
    given = samples.innovations
    innovation, variance = given.innovation[0], given.innovation_variance[0]
    yield "sum_squared_innovation", np.square(innovation)
    yield "sum_nis", np.square(innovation) / variance
    yield "sum_nis_winsorised", np.square(winsorised(innovation, given.winsor_limits()[0])) / variance
    yield "sum_log_variance", np.log(variance)
    yield "sum_nll", gaussian_nll(innovation, variance)
    yield "sum_nll_student_t", student_t_nll(innovation, variance)
