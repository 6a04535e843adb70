"""Rows of a replay (see `recording.py`) as columns, under the names that PX4's estimator topics have."""

from __future__ import annotations

import numpy as np
import pyarrow as pa

from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES
from fusetune.ekf2.replay.recording import FLAG_COLUMNS


def innovation_table(rows: np.ndarray) -> pa.Table:
    """One row per aid-source sample and axis; `innovation_variance` includes the observation's."""
    source = pa.DictionaryArray.from_arrays(pa.array(rows["source"]), pa.array(AID_SOURCE_NAMES))
    names = [name for name in rows.dtype.names or () if name != "source"]
    return pa.table({"source": source} | {name: np.ascontiguousarray(rows[name]) for name in names})


def state_table(rows: np.ndarray) -> pa.Table:
    """One row per filter update: `states_0` … `states_24` and `covariances_0` … `covariances_23` (the variances)."""
    return _flattened(rows, ("states", "covariances"))


def local_position_table(rows: np.ndarray) -> pa.Table:
    """One row per filter update: what the output predictor publishes at the newest IMU sample."""
    return _flattened(rows, ("q",))


def flags_table(rows: np.ndarray) -> pa.Table:
    """One row per change of a flag, at least one a second."""
    flags = rows["flags"].astype(bool)
    columns = {name: np.ascontiguousarray(flags[:, i]) for i, name in enumerate(FLAG_COLUMNS)}
    return pa.table({"timestamp": np.ascontiguousarray(rows["timestamp"])} | columns)


def _flattened(rows: np.ndarray, arrays: tuple[str, ...]) -> pa.Table:
    columns: dict[str, np.ndarray] = {}
    for name in rows.dtype.names or ():
        if name not in arrays:
            columns[name] = np.ascontiguousarray(rows[name])
            continue
        for i in range(rows[name].shape[1]):
            columns[f"{name}_{i}"] = np.ascontiguousarray(rows[name][:, i])
    return pa.table(columns)
