"""What the tables of a replay hold: rows as the replay records them, as columns named as in PX4's estimator topics.

The fields of a row are said where it is recorded: `INNOVATION_ROW`, `STATE_ROW`, `LOCAL_POSITION_ROW` and
`FLAG_COLUMNS` in `fusetune.ekf2.replay.recording`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from fusetune.analyze.replaying.gap_predictions import gap_predictions
from fusetune.analyze.replaying.store.parts import PREDICTED, RECORDED
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES
from fusetune.ekf2.replay.recording import FLAG_COLUMNS, FLAGS_ROW, INNOVATION_ROW, LOCAL_POSITION_ROW, STATE_ROW
from fusetune.ekf2.replay.results import GapResult

_ENDS = ("timestamp", "x", "y", "z", "vx", "vy", "vz")


class RecordedTable(NamedTuple):
    """A table that is written while the replay goes on: dtype of its rows, and what makes columns of them."""

    row: np.dtype
    to_table: Callable[[np.ndarray], pa.Table]


def innovation_table(rows: np.ndarray, measured: np.ndarray | None = None) -> pa.Table:
    """One row per aid-source sample and axis; `innovation_variance` includes the observation's.

    Parameters
    ----------
    measured : whether the measurement of each row stands in the log; a column only where some do not
    """
    source = pa.DictionaryArray.from_arrays(pa.array(rows["source"]), pa.array(AID_SOURCE_NAMES))
    names = [name for name in rows.dtype.names or () if name != "source"]
    table = pa.table({"source": source} | {name: np.ascontiguousarray(rows[name]) for name in names})
    return table if measured is None else table.append_column("measured", pa.array(measured))


def state_table(rows: np.ndarray) -> pa.Table:
    """One row per filter update: `states_0` … `states_24` and `covariances_0` … `covariances_23` (the variances).

    `delta_angle_0` … `delta_velocity_dt` are the IMU interval of its prediction.
    """
    return _flattened(rows, ("states", "covariances", "delta_angle", "delta_velocity"))


def local_position_table(rows: np.ndarray) -> pa.Table:
    """One row per filter update: what the output predictor publishes at the newest IMU sample."""
    return _flattened(rows, ("q",))


def flags_table(rows: np.ndarray) -> pa.Table:
    """One row per change of a flag, at least one a second."""
    return pa.table(flag_columns(rows))


def flag_columns(rows: np.ndarray) -> dict[str, np.ndarray]:
    """The same as arrays."""
    flags = np.ascontiguousarray(rows["flags"].T) != 0
    return {"timestamp": np.ascontiguousarray(rows["timestamp"]), **dict(zip(FLAG_COLUMNS, flags, strict=True))}


def prediction_table(results: Sequence[GapResult]) -> pa.Table:
    """Mean innovation over the last second before each horizon: one row per gap, source, axis and horizon.

    `innovation_variance` is the mean of the variances that the filter claims; `n` counts the averaged samples.
    """
    table = gap_predictions(results)
    sensors = pa.array([result.gap.sensor for result in results], pa.string())
    source = pa.DictionaryArray.from_arrays(pa.array(table.pop("source")), pa.array(AID_SOURCE_NAMES))
    return pa.table({"sensor": sensors.take(pa.array(table["gap"])), "source": source} | table)


def prediction_columns(results: Sequence[GapResult]) -> dict[str, np.ndarray]:
    """The same as arrays."""
    table = gap_predictions(results)
    sensors = np.array([result.gap.sensor for result in results], object)
    sources = np.array(AID_SOURCE_NAMES, object)[table.pop("source")]
    return {"sensor": sensors[table["gap"]], "source": sources} | table


def gap_table(results: Sequence[GapResult]) -> pa.Table:
    """Published position and velocity (NED, m and m/s) at the beginning and the end of every gap."""
    columns = gap_columns(results)
    return pa.table(columns | {"sensor": pa.array(columns["sensor"], pa.string())})


def gap_columns(results: Sequence[GapResult]) -> dict[str, np.ndarray]:
    """The same as arrays."""
    columns = {
        "sensor": np.array([result.gap.sensor for result in results], object),
        "start": np.array([result.gap.start for result in results], np.int64),
        "stop": np.array([result.gap.stop for result in results], np.int64),
    }
    for row, moment in enumerate(("begin", "end")):
        for name in _ENDS:
            values = [result.local_position[name][row] for result in results]
            columns[f"{name}_{moment}"] = np.array(values, np.int64 if name == "timestamp" else np.float64)
    return columns


def _flattened(rows: np.ndarray, arrays: tuple[str, ...]) -> pa.Table:
    columns: dict[str, np.ndarray] = {}
    for name in rows.dtype.names or ():
        if name not in arrays:
            columns[name] = np.ascontiguousarray(rows[name])
            continue
        for i in range(rows[name].shape[1]):
            columns[f"{name}_{i}"] = np.ascontiguousarray(rows[name][:, i])
    return pa.table(columns)


RECORDED_TABLES: Mapping[str, RecordedTable] = dict(
    zip(
        RECORDED,
        (
            RecordedTable(INNOVATION_ROW, innovation_table),
            RecordedTable(STATE_ROW, state_table),
            RecordedTable(LOCAL_POSITION_ROW, local_position_table),
            RecordedTable(FLAGS_ROW, flags_table),
        ),
        strict=True,
    )
)
"""In the order of `fusetune.ekf2.replay.recording.RecordArrays`."""

PREDICTED_TABLES: Mapping[str, Callable[[Sequence[GapResult]], pa.Table]] = dict(
    zip(PREDICTED, (prediction_table, gap_table), strict=True)
)
