"""How far GNSS wanders while the vehicle stands, as EKF2 filters it; before v1.13 no log holds it.

The figures of PX4 v1.16 `EKF/aid_sources/gnss/gps_checks.cpp`, of which the estimator's own copy works on its memory:
`fusetune.ekf2.filter.aid_sources.gnss.gps_checks`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.px4.flight import TopicTable
from fusetune.px4.layouts.logged_state import METRES_PER_DEGREE, MIN_FIX_TYPE

DRIFT_TIME_CONSTANT_S = 10.0
_LEAST_STEP_S, _LIMIT_FACTOR = 1e-3, 10.0
Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Drift:
    """Filtered figures at the samples at rest, (N,) each.

    Attributes
    ----------
    time : µs
    drift_horizontal, drift_vertical : of the position, m/s
    speed_at_rest : horizontal, that the receiver reports, m/s
    settled : whether the vehicle has stood for the filter's time constant
    """

    time: npt.NDArray[np.int64]
    drift_horizontal: Array
    drift_vertical: Array
    speed_at_rest: Array
    settled: npt.NDArray[np.bool_]


def drift_at_rest(table: TopicTable, at_rest: npt.NDArray[np.bool_], parameters: Mapping[str, float]) -> Drift | None:
    """Drift of GNSS at the samples taken at rest; None without two of them with a fix.

    Each figure is a first-order low-pass of 10 s, x ← x + (v − x) dt / 10 s, of the change of position over dt and of
    the velocity, both held within ten times their limits; it begins anew whenever the vehicle moves.

    Parameters
    ----------
    table : `vehicle_gps_position` in the layout of v1.16
    at_rest : (rows,)
    parameters : with EKF2_REQ_HDRIFT and EKF2_REQ_VDRIFT
    """
    needed = ("latitude_deg", "longitude_deg", "altitude_msl_m", "vel_n_m_s", "vel_e_m_s", "fix_type")
    if any(name not in table for name in needed):
        return None
    has_fix = table["fix_type"] >= MIN_FIX_TYPE
    if (at_rest & has_fix).sum() < 2:
        return None
    time, rest = table["timestamp"][has_fix].astype(np.int64), at_rest[has_fix]
    columns = {name: table[name][has_fix].astype(np.float64) for name in needed}
    limit = _LIMIT_FACTOR * np.array([parameters[name] for name in ("EKF2_REQ_HDRIFT", "EKF2_REQ_VDRIFT")])
    step = np.clip(np.diff(time, prepend=time[:1]) * 1e-6, _LEAST_STEP_S, DRIFT_TIME_CONSTANT_S)
    east = METRES_PER_DEGREE * np.cos(np.radians(columns["latitude_deg"]))
    moved = np.column_stack(
        [
            np.diff(columns["latitude_deg"], prepend=columns["latitude_deg"][:1]) * METRES_PER_DEGREE,
            np.diff(columns["longitude_deg"], prepend=columns["longitude_deg"][:1]) * east,
            -np.diff(columns["altitude_msl_m"], prepend=columns["altitude_msl_m"][:1]),
        ]
    )
    speeds = np.column_stack([moved / step[:, None], columns["vel_n_m_s"], columns["vel_e_m_s"]])
    limits = limit[[0, 0, 1, 0, 0]]
    filtered, since = _low_pass(np.clip(speeds, -limits, limits), step, time, rest)
    return Drift(
        time=time[rest],
        drift_horizontal=np.hypot(filtered[rest, 0], filtered[rest, 1]),
        drift_vertical=np.abs(filtered[rest, 2]),
        speed_at_rest=np.hypot(filtered[rest, 3], filtered[rest, 4]),
        settled=since[rest] >= DRIFT_TIME_CONSTANT_S,
    )


def _low_pass(
    values: Array, step: Array, time: npt.NDArray[np.int64], rest: npt.NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Filtered values (N, K), zero whenever the vehicle moves, and for how long it has stood, s."""
    filtered, since = np.zeros_like(values), np.zeros(len(values))
    state, begun = np.zeros(values.shape[1]), 0
    for row in range(len(values)):
        if not rest[row]:
            state = np.zeros_like(state)
            continue
        begun = row if not row or not rest[row - 1] else begun
        coefficient = step[row] / DRIFT_TIME_CONSTANT_S
        state = values[row] * coefficient + state * (1.0 - coefficient)
        filtered[row], since[row] = state, (time[row] - time[begun]) * 1e-6
    return filtered, since
