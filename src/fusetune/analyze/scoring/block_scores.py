"""Sums over blocks of about 10 s: all that the decision needs, additive so that blocks can be redrawn."""

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.metrics.likelihood import gaussian_nll, student_t_nll, winsorised
from fusetune.analyze.scoring.columns import FLIGHT_AND_SET, SOURCE_AND_AXIS, columns_of
from fusetune.analyze.scoring.measurement_alignment import PairedSamples, SamplesOfSet

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


def block_rows(flight: str, pairs: PairedSamples, edges: npt.NDArray[np.int64]) -> pa.Table:
    """Sum the scores of one source and axis over blocks.

    Parameters
    ----------
    edges : (B + 1,) edges of the blocks, µs; blocks without samples have no row
    """
    block = np.clip(np.searchsorted(edges, pairs.time, side="right") - 1, 0, edges.size - 2)
    starts = np.flatnonzero(np.r_[True, np.diff(block) != 0])
    counts = np.diff(np.r_[starts, block.size])
    sets = len(pairs.sets)
    sums = [_sums(one, pairs.winsor_limit, starts) for one in pairs.each()]
    rows = sets * starts.size
    columns: dict[str, pa.Array] = {
        "flight": pa.array([flight] * rows, pa.string()),
        "set": pa.array(np.repeat(np.array(pairs.sets, dtype=object), starts.size), pa.string()),
        "source": pa.array([pairs.source] * rows, pa.string()),
        "axis": pa.array(np.full(rows, pairs.axis, dtype=np.int32)),
        "block": pa.array(np.tile(block[starts].astype(np.int32), sets)),
        "n": pa.array(np.tile(counts.astype(np.int64), sets)),
    }
    for name in sums[0]:
        columns[name] = pa.array(np.concatenate([one[name] for one in sums]))
    return pa.table(columns, schema=BLOCK_SCHEMA)


def _sums(pairs: SamplesOfSet, limit: float, starts: npt.NDArray[np.int64]) -> dict[str, npt.NDArray[np.float64]]:
    """Sums (B,) of one set over the blocks that begin at the rows `starts`."""
    innovation, variance = pairs.innovation[0], pairs.innovation_variance[0]
    clipped = winsorised(innovation, limit)
    scores = {
        "sum_squared_innovation": np.square(innovation),
        "sum_nis": np.square(innovation) / variance,
        "sum_nis_winsorised": np.square(clipped) / variance,
        "sum_log_variance": np.log(variance),
        "sum_nll": gaussian_nll(innovation, variance),
        "sum_nll_student_t": student_t_nll(innovation, variance),
    }
    return {name: np.add.reduceat(values, starts) for name, values in scores.items()}
