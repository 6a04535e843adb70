"""The states and variances that a replay holds at every update of the filter, on the fusion time horizon."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fusetune.analyze.set_files import read_columns
from fusetune.ekf2 import state
from fusetune.files import AnyPath

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


def read_states(folder: AnyPath, name: str) -> FilterStates:
    """Read `<folder>/<name>.states.parquet`.

    Raises
    ------
    UserError
        If the file is missing or damaged.
    """
    folder = Path(folder)
    published = [*_indices(state.PUBLISHED_QUATERNION, 4), *_indices(state.PUBLISHED_VELOCITY, 3)]
    blocks = (state.ATTITUDE, state.VELOCITY, state.POSITION)
    columns = ["timestamp_sample", *(f"states_{i}" for i in published)]
    columns += [f"covariances_{i}" for first in blocks for i in _indices(first, 3)]
    table = read_columns(folder / f"{name}.states.parquet", columns)

    def block(prefix: str, first: int, size: int) -> Array:
        return np.column_stack([table[f"{prefix}_{i}"] for i in _indices(first, size)]).astype(np.float64)

    attitude, velocity, position = (block("covariances", first, 3) for first in blocks)
    return FilterStates(
        time=table["timestamp_sample"].astype(np.int64),
        quaternion=block("states", state.PUBLISHED_QUATERNION, 4),
        velocity=block("states", state.PUBLISHED_VELOCITY, 3),
        attitude_variance=attitude,
        velocity_variance=velocity,
        position_variance=position,
    )


def _indices(first: int, size: int) -> range:
    return range(first, first + size)
