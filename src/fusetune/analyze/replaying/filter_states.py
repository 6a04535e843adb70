"""The states and variances that a replay holds at every update of the filter, on the fusion time horizon."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fusetune.analyze.replaying.set_files import read_columns_in_pieces
from fusetune.ekf2.filter.common import state
from fusetune.storage.files import AnyPath

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class FilterStates:
    """States after each update, N rows in order of time.

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


_BLOCKS = {
    "quaternion": ("states", state.PUBLISHED_QUATERNION, 4),
    "velocity": ("states", state.PUBLISHED_VELOCITY, 3),
    "attitude_variance": ("covariances", state.ATTITUDE, 3),
    "velocity_variance": ("covariances", state.VELOCITY, 3),
    "position_variance": ("covariances", state.POSITION, 3),
}
"""Columns of the file that make an array: prefix, first index, number."""


def read_states(folder: AnyPath, name: str) -> FilterStates:
    """Read `<folder>/<name>.states.parquet`.

    Raises
    ------
    UserError
        If the file is missing or damaged.
    """
    blocks = _BLOCKS.values()
    columns = [
        "timestamp_sample",
        *(f"{prefix}_{i}" for prefix, first, size in blocks for i in range(first, first + size)),
    ]
    parts: dict[str, list[npt.NDArray]] = {name: [] for name in ("time", *_BLOCKS)}
    for piece in read_columns_in_pieces(Path(folder) / f"{name}.states.parquet", columns):
        parts["time"].append(piece["timestamp_sample"].astype(np.int64))
        for block, (prefix, first, size) in _BLOCKS.items():
            values = np.column_stack([piece[f"{prefix}_{i}"] for i in range(first, first + size)])
            parts[block].append(values.astype(np.float64))
    shapes = {"time": np.zeros(0, np.int64)} | {name: np.zeros((0, size)) for name, (_, _, size) in _BLOCKS.items()}
    return FilterStates(**{block: np.concatenate([shapes[block], *parts.pop(block)]) for block in shapes})
