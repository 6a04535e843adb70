"""States and variances of the vehicle's own estimator over a flight, in the units and parts of v1.16."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusetune.px4.flight import Flight, TopicTable, row_count, stacked
from fusetune.px4.layouts.estimator_instances import rows_of_primary
from fusetune.px4.layouts.state_layout import UPDATE_INTERVAL_S, state_layout

Array = npt.NDArray[np.float64]

_PARTS: Mapping[str, slice] = {
    "velocity": slice(4, 7),
    "gyro_bias": slice(10, 13),
    "accel_bias": slice(13, 16),
    "mag_earth": slice(16, 19),
    "mag_body": slice(19, 22),
    "wind": slice(22, 24),
}
"""In the state vector of every release; places of states and heights differ."""
_VARIANCES: Mapping[str, slice] = {
    "position": slice(6, 9),
    **{name: slice(part.start - 1, part.stop - 1) for name, part in _PARTS.items()},
}
"""Of releases with three variances of a rotation; before, a quaternion has four."""
_BIASES = ("gyro_bias", "accel_bias")


class LoggedStates(NamedTuple):
    """Parts of the state by name, (N, size) each.

    Attributes
    ----------
    time : (N,) µs, of publication
    values : velocity, biases (rad/s, m/s²), fields (Gauss) and wind, NED or body
    variances : of them, of the position and, where the release tells it, of the attitude as a rotation in NED
    """

    time: npt.NDArray[np.int64]
    values: Mapping[str, Array]
    variances: Mapping[str, Array]


def logged_state_series(flight: Flight) -> LoggedStates | None:
    """Of the estimator that was primary at each time; None where the log holds no states that can be read.

    Parameters
    ----------
    flight : canonical, with `estimator_states`, `estimator_sensor_bias` and `estimator_selector_status`
    """
    table = rows_of_primary(flight, "estimator_states")
    if table is None or not row_count(table):
        return None
    layout = state_layout(table, rows_of_primary(flight, "estimator_sensor_bias"))
    if layout is None:
        return None
    states, variances = stacked(table, "states"), np.maximum(stacked(table, "covariances"), 0.0)
    further = 0 if layout.has_rotation_variances else 1
    scale = 1.0 if layout.has_bias_rates else 1.0 / UPDATE_INTERVAL_S
    values = {name: states[:, part] * (scale if name in _BIASES else 1.0) for name, part in _PARTS.items()}
    spread = {
        name: variances[:, part.start + further : part.stop + further] * (scale**2 if name in _BIASES else 1.0)
        for name, part in _VARIANCES.items()
    }
    if layout.has_rotation_variances:
        spread["attitude"] = variances[:, :3]
    return LoggedStates(table["timestamp"].astype(np.int64), values, spread)


def logged_biases(flight: Flight) -> LoggedStates | None:
    """Biases with their variances, of the topic that tells them most often; None where the log holds none.

    `estimator_sensor_bias` is published when they change. Its variances are those of rates only in releases whose
    states are rates; before, they are divided by the update interval once where it takes twice, and the states serve.

    Parameters
    ----------
    flight : as of `logged_state_series`
    """
    states, table = rows_of_primary(flight, "estimator_states"), rows_of_primary(flight, "estimator_sensor_bias")
    layout = None if states is None or not row_count(states) else state_layout(states, table)
    if layout is None or not layout.has_bias_rates or table is None or not _tells_biases(table):
        return logged_state_series(flight)
    values = {name: stacked(table, name) for name in _BIASES}
    spread = {name: np.maximum(stacked(table, f"{name}_variance"), 0.0) for name in _BIASES}
    return LoggedStates(table["timestamp"].astype(np.int64), values, spread)


def _tells_biases(table: TopicTable) -> bool:
    return bool(row_count(table)) and all(f"{name}{end}[2]" in table for name in _BIASES for end in ("", "_variance"))
