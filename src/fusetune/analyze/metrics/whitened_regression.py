"""Regression of a time series whose residuals are correlated in time, with standard errors that know it.

An autoregressive model of the residuals, fitted to themselves, makes them white, and the regressors with them (Cochrane
and Orcutt, 1949); residuals beyond what is usual weigh less (Huber, 1964). The standard errors are those of the
jackknife over blocks of some seconds (Tukey, 1958), or what the residuals promise, where that is wider.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusetune.analyze.metrics.grouping import distinct, rows_of
from fusetune.analyze.metrics.likelihood import NORMAL_CONSISTENCY

Array = npt.NDArray[np.float64]

BLOCK_S = 5.0
FEWEST_BLOCKS = 4
MEMORY_S = 3.0
"""Of the autoregressive model."""
LONGEST_MEMORY = 40
FEWEST_ROWS = 40
_HUBER = 2.0
_GAP_STEPS = 1.5


class Rows(NamedTuple):
    """A run of a series: (N, D) what is left of the measurement, (N, D, P) its regressors, (N,) times in s."""

    left: Array
    design: Array
    when: Array


def order_of(step_s: float) -> int:
    """Order of the autoregressive model of a series with that step."""
    return int(np.clip(round(MEMORY_S / step_s), 2, LONGEST_MEMORY))


def runs(time: npt.NDArray[np.int64], fewest: int = FEWEST_ROWS) -> Iterator[slice]:
    """Parts of a series without gaps, those that are long enough; `time` (N,) ascending."""
    if time.size < fewest:
        return
    step = np.diff(time)
    cuts = np.flatnonzero(step > _GAP_STEPS * np.median(step)) + 1
    for start, stop in zip([0, *cuts.tolist()], [*cuts.tolist(), time.size], strict=True):
        if stop - start >= fewest:
            yield slice(start, stop)


@dataclass(frozen=True)
class Fit:
    """White rows of a regression, their weights, and its solution, (P,)."""

    design: Array
    residual: Array
    weight: Array
    when: Array
    solution: Array

    def standard_errors(self) -> tuple[Array, int] | None:
        """Of each element of the solution, (P,), and the number of blocks behind them; None where there are too few."""
        scaled, target = self.design * self.weight[:, None], self.residual * self.weight
        block = np.floor((self.when - self.when.min()) / BLOCK_S).astype(np.int64)
        blocks = distinct(block)
        if blocks.size < FEWEST_BLOCKS:
            return None
        normal, moment = scaled.T @ scaled, scaled.T @ target
        without = []
        for own in rows_of(block, blocks):
            part, rest = scaled[own], target[own]
            without.append(np.linalg.lstsq(normal - part.T @ part, moment - part.T @ rest, rcond=None)[0])
        spread = np.sum((np.array(without) - np.mean(without, axis=0)) ** 2, axis=0)
        jackknife = (blocks.size - 1) / blocks.size * spread
        return np.asarray(np.sqrt(np.maximum(jackknife, np.square(self.promised_errors())))), int(blocks.size)

    def promised_errors(self) -> Array:
        """What the residuals promise of each element, (P,): of an effect that shows but once there is no other."""
        scaled, target = self.design * self.weight[:, None], self.residual * self.weight
        left = target - scaled @ self.solution
        variance = float(left @ left) / max(left.size - self.solution.size, 1)
        return np.asarray(np.sqrt(np.maximum(variance * np.diag(np.linalg.pinv(scaled.T @ scaled)), 0.0)))


def generalised(rows: list[Rows], order: int) -> Fit:
    """Least squares over white rows of usual size; the filter that makes them white is fitted to what is left."""
    axes, parameters = rows[0].design.shape[1:]
    solution: Array = np.zeros(parameters)
    for _ in range(2):
        white = [_whitened(rows, solution, axis, order) for axis in range(axes)]
        residual, design, when = (np.concatenate([one[part] for one in white]) for part in range(3))
        weight: Array = np.ones(residual.size)
        for _ in range(3):
            solution = np.asarray(np.linalg.lstsq(design * weight[:, None], residual * weight, rcond=None)[0])
            left = np.asarray(np.abs(residual - design @ solution))
            weight = np.asarray(np.sqrt(np.minimum(1.0, _HUBER / np.maximum(left, 1e-12))))
    return Fit(design, residual, weight, when, solution)


def _whitened(rows: list[Rows], solution: Array, axis: int, order: int) -> tuple[Array, Array, Array]:
    """Rows and regressors of one axis through the filter that makes what is left white and of unit size; times."""
    windows = [_windows(row.left[:, axis] - row.design[:, axis] @ solution, order) for row in rows]
    past, now = np.concatenate([one[:, :-1] for one in windows]), np.concatenate([one[:, -1] for one in windows])
    usual_size = 6.0 * _size(now)
    usual = (np.abs(now) < usual_size) & (np.abs(past) < usual_size).all(axis=1)
    if np.count_nonzero(usual) > 3 * order:
        past, now = past[usual], now[usual]
    makes_white = np.append(-np.linalg.lstsq(past.T @ past, past.T @ now, rcond=1e-12)[0], 1.0)
    makes_white /= max(_size(now + past @ makes_white[:-1]), 1e-12)
    return (
        np.concatenate([_windows(row.left[:, axis], order) @ makes_white for row in rows]),
        np.concatenate([_windows(row.design[:, axis], order) @ makes_white for row in rows]),
        np.concatenate([row.when[order:] for row in rows]),
    )


def _windows(values: Array, order: int) -> Array:
    """Each value behind those before it, (N − order, …, order + 1)."""
    return np.lib.stride_tricks.sliding_window_view(values, order + 1, axis=0)


def _size(values: Array) -> float:
    """Robust standard deviation."""
    return NORMAL_CONSISTENCY * float(np.median(np.abs(values - np.median(values))))
