"""Time constants of the output predictor, `EKF2_TAU_VEL` and `EKF2_TAU_POS`, by the tracking error that the log has.

The predictor follows the filter, which is late by the horizon, with a first-order lag of that constant: what drives the
two apart at a steady rate leaves an error that grows with it, while the filter's own jumps come through the faster the
shorter it is. So a constant is shortened by as much as the median error is above what PX4's log analysis warns of, and
stays as it is otherwise. A longer horizon (largest delay) raises the error, too: delays of sensors that are not used
belong at 0.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.special import stdtrit

from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.told import refused
from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.metrics.grouping import distinct
from fusetune.analyze.observed.observed_flight import ObservedFlight

Array = npt.NDArray[np.float64]

WARNED = (("EKF2_TAU_VEL", 1, 0.05), ("EKF2_TAU_POS", 2, 0.15))
"""Parameter, element of `output_tracking_error`, and median that PX4's `ecl_ekf` scripts warn of, m/s and m."""
SHORTEST_S = 0.1
_BLOCK_S = 10.0
_FEWEST_BLOCKS = 4


def estimate_output_predictor(observed: ObservedFlight) -> Effect:
    """Time constants of velocity and position."""
    name = "output_predictor"
    table = observed.flight.topic("estimator_status") or observed.logged.topic("estimator_status")
    if table is None or "output_tracking_error[2]" not in table:
        return refused(
            name, "the log has no `estimator_status.output_tracking_error`: log it (SDLOG_PROFILE, any but 0)"
        )
    time = table["timestamp"].astype(np.int64)
    rows = inside(time, observed.clear_of_ground)
    errors = np.column_stack([np.asarray(table[f"output_tracking_error[{one}]"], np.float64) for one in range(3)])
    rows &= np.isfinite(errors).all(axis=1)
    block = np.floor(time / (_BLOCK_S * 1e6)).astype(np.int64)[rows]
    if distinct(block).size < _FEWEST_BLOCKS:
        return refused(name, "too short a time in the air away from the ground; fly for a minute")
    if not np.any(errors[rows]):
        return refused(name, "the tracking error is 0 throughout: the log does not come from a flying vehicle")
    estimates, figures = [], {}
    for parameter, place, limit in WARNED:
        values = np.abs(errors[rows, place])
        told = observed.parameters.get(parameter, 0.25)
        middle, half, error = _median(values, block)
        figures[f"median_error_{'m_s' if place == 1 else 'm'}"] = middle
        estimates.append(
            Estimate(
                parameter, "s", told, _shortened(told, middle, limit), _shortened(told, middle + half, limit),
                _shortened(told, max(middle - half, 0.0), limit), told * error * limit / max(middle, limit) ** 2,
                int(values.size),
            )
        )  # fmt: skip
    return Effect(name, tuple(estimates), "", figures)


def _median(values: Array, block: npt.NDArray[np.int64]) -> tuple[float, float, float]:
    """Median, half of its interval and standard error, by the jackknife over blocks."""
    blocks = distinct(block)
    without = np.array([float(np.median(values[block != one])) for one in blocks])
    error = float(np.sqrt((blocks.size - 1) * np.var(without)))
    return float(np.median(values)), float(stdtrit(blocks.size - 1, 0.975)) * error, error


def _shortened(told: float, error: float, limit: float) -> float:
    return told if error <= limit else max(told * limit / error, min(SHORTEST_S, told))
