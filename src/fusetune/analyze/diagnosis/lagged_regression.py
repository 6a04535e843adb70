"""A measured series against a course of the motion, with the delay as one more unknown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.metrics.whitened_regression import Rows, generalised, order_of, runs

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

Course = Callable[[Times], tuple[Array, Array]]
"""For times of the motion: what is expected of the measurements, (N, D), and what each unknown adds, (N, D, P); the
first unknown is how much later the measurement is, s."""

LARGEST_CHANGE_S = 0.3
"""Further from what it is told no delay is looked for."""
_ROUNDS = 8
_STANDS_S = 2e-3
_GREATEST_STEP_S = 0.1


@dataclass(frozen=True)
class LaggedFit:
    """What was found.

    Attributes
    ----------
    delay_s, delay_error_s : against the times given, and its standard error
    values, errors : (P − 1,) the other unknowns
    samples, blocks : measurements, and independent parts of the flight behind the errors
    noise : robust standard deviation of the white part of each measurement
    """

    delay_s: float
    delay_error_s: float
    values: Array
    errors: Array
    samples: int
    blocks: int
    noise: float


def lagged_fit(time: Times, measured: Array, course: Course, told_s: float, differences: int = 1) -> LaggedFit | None:
    """Fit; None where there is too little of the series, or no delay near the told one fits.

    Parameters
    ----------
    time : (N,) of the messages, µs, ascending
    measured : (N, D)
    differences : how often the series is differenced: 1 for a velocity, 2 for a position
    """
    parts = list(runs(time)) if time.size > 1 else []
    if not parts:
        return None
    order = order_of(float(np.median(np.diff(time))) * 1e-6)
    delay_s = told_s
    for _ in range(_ROUNDS):
        at = time - round(delay_s * 1e6)
        expected, design = course(at)
        rows = []
        for part in parts:
            if part.stop - part.start > 2 * order + 2 + differences:
                left, columns = (np.diff(one[part], differences, axis=0) for one in (measured - expected, design))
                rows.append(Rows(left, columns, np.asarray(at[part][differences:] * 1e-6, np.float64)))
        if not rows:
            return None
        fit = generalised(rows, order)
        change = float(np.clip(fit.solution[0], -_GREATEST_STEP_S, _GREATEST_STEP_S))
        if not np.isfinite(change) or abs(delay_s + change - told_s) > LARGEST_CHANGE_S:
            return None
        delay_s += change
        if abs(change) < _STANDS_S:
            break
    errors = fit.standard_errors()
    if errors is None:
        return None
    error, blocks = errors
    left = np.concatenate([(row.left - row.design @ fit.solution).ravel() for row in rows])
    size = np.sqrt(2.0) if differences == 1 else np.sqrt(6.0)
    noise = float(np.median(np.abs(left)) / 0.6745 / size)
    return LaggedFit(delay_s, float(error[0]), fit.solution[1:], error[1:], time.size, blocks, noise)


def about_down(angle: float) -> Array:
    """Rotation (3, 3) about the vertical, rad."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def turned_by(expected: Array, measured: Array, apart: int) -> float:
    """Angle about the vertical that turns the changes of one series (N, 2+) over so many samples onto another's."""
    one, other = (values[apart:, :2] - values[:-apart, :2] for values in (expected, measured))
    cross = float(np.nansum(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]))
    return float(np.arctan2(cross, float(np.nansum(one * other))))
