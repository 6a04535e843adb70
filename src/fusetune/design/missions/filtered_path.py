"""Smooth paths through knots: a piecewise linear path in time, filtered by moving averages.

A path that runs along straight legs at constant velocity is averaged over three windows of T₁, T₂ and T₃ seconds, one
after the other. The result is three times continuously differentiable and its limits follow from the windows alone
(Biagiotti and Melchiorri, "FIR filters for online trajectory planning with time- and frequency-domain specifications",
Control Engineering Practice 20, 2012):

* every velocity is a weighted mean of leg velocities, so the largest leg speed is never exceeded;
* acceleration is at most the largest change of leg velocity over T₁;
* jerk is at most twice the acceleration limit over T₂.

A corner is cut where the legs simply follow each other; on a leg the path is exactly straight from half the total
window after its start to half the total window before its end.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np


def window_lengths(
    largest_velocity_change: float, acceleration: float, jerk: float, *, snap_window_s: float = 0.3
) -> tuple[float, float, float]:
    """Windows (s) that keep the limits of acceleration and jerk whatever the legs are."""
    velocity_window = max(largest_velocity_change / acceleration, 1e-3)
    return velocity_window, 2.0 * acceleration / jerk, snap_window_s


@dataclass(frozen=True)
class FilteredPath:
    """A piecewise linear path filtered by three moving averages, with exact derivatives.

    Parameters
    ----------
    times_s
        (K,) times of the knots, ascending.
    knots
        (K, D) values at the knots. Before the first and after the last knot the path rests.
    windows_s
        Lengths of the three windows. They are centred, so the path is delayed by nothing.
    """

    times_s: np.ndarray
    knots: np.ndarray
    windows_s: tuple[float, float, float]

    @property
    def half_window_s(self) -> float:
        """Half the total window: how long before and after a corner the path is bent."""
        return 0.5 * sum(self.windows_s)

    def evaluate(self, time_s: np.ndarray, derivative: int = 0) -> np.ndarray:
        """Path or one of its first three derivatives at ascending times.

        Parameters
        ----------
        time_s
            (N,) ascending.
        derivative
            0 position, 1 velocity, 2 acceleration, 3 jerk.

        Returns
        -------
        (N, D) array.
        """
        result = self._unfiltered(time_s, derivative)
        slopes = np.diff(self.knots, axis=0) / np.diff(self.times_s)[:, None]
        rest = np.zeros((1, self.knots.shape[1]))
        slope_changes = np.diff(np.concatenate([rest, slopes, rest]), axis=0)
        half = self.half_window_s
        for knot_s, change in zip(self.times_s, slope_changes, strict=True):
            first, last = np.searchsorted(time_s, [knot_s - half, knot_s + half])
            local = time_s[first:last] - knot_s
            rounding = _filtered_ramp(local, self.windows_s, derivative) - _ramp(local, derivative)
            result[first:last] += rounding[:, None] * change
        return result

    def _unfiltered(self, time_s: np.ndarray, derivative: int) -> np.ndarray:
        if derivative == 0:
            return np.stack([np.interp(time_s, self.times_s, column) for column in self.knots.T], axis=-1)
        result = np.zeros((len(time_s), self.knots.shape[1]))
        if derivative == 1:
            slopes = np.diff(self.knots, axis=0) / np.diff(self.times_s)[:, None]
            leg = np.searchsorted(self.times_s, time_s, side="right") - 1
            inside = (leg >= 0) & (leg < len(slopes))
            result[inside] = slopes[leg[inside]]
        return result


def _ramp(time_s: np.ndarray, derivative: int) -> np.ndarray:
    if derivative == 0:
        return np.maximum(time_s, 0.0)
    return (time_s >= 0.0).astype(np.float64) if derivative == 1 else np.zeros_like(time_s)


def _filtered_ramp(time_s: np.ndarray, windows_s: tuple[float, ...], derivative: int) -> np.ndarray:
    """A unit ramp from 0 averaged over all windows, or its derivative, by truncated powers.

    Averaging over a window T is integration followed by a difference over T, so the ramp becomes a sum of shifted
    powers t⁴/4!, divided by the product of the windows.
    """
    power = 1 + len(windows_s) - derivative
    result = np.zeros_like(time_s)
    for signs in np.ndindex(*(2,) * len(windows_s)):
        shift = sum(0.5 * window * (1 - 2 * sign) for window, sign in zip(windows_s, signs, strict=True))
        weight = -1.0 if sum(signs) % 2 else 1.0
        result += weight * np.maximum(time_s + shift, 0.0) ** power
    return result / (factorial(power) * np.prod(windows_s))
