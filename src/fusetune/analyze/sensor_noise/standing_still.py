"""When the vehicle stood still: on the ground, disarmed, and its IMU as quiet as it ever is there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.flight.phases import intervals_where
from fusetune.analyze.sensor_noise.sensor_series import GAP_STEPS, SensorSeries
from fusetune.px4.flight import Flight

WINDOW_S = 0.5
SHORTEST_S = 3.0
"""Shorter stretches are left out: an Allan curve of less has too few octaves."""
CLEAR_OF_FLIGHT_US = 1_000_000
"""The land detector tells take-off late, and landing before the vehicle has come to rest."""
QUIET = 1.5
"""A window is still whose spread is at most so many times that of the quietest tenth; chance makes 1.2 of 25 rows."""
QUIETEST = 10.0
MOST_GYRO = 0.05
MOST_ACCEL = 0.6
"""Spread beyond which no autopilot stands still, rad/s and m/s²: ten times the noise of the worst MEMS sensors at
100 Hz, so that a log that is shaken throughout has no quietest part."""
MOST_TURNING = 0.1
"""Mean rate beyond which it turns, rad/s: more than an uncalibrated gyro's bias."""
MOST_TILTING = 0.05
"""Change of the mean specific force from window to window, m/s²: 0.3°; the noise of the mean comes on top."""
_ARMED = 2
_SEVERAL = 4.0


def standing_still(
    flight: Flight, gyro: SensorSeries, accel: SensorSeries, airborne: Sequence[Interval]
) -> tuple[Interval, ...]:
    """Intervals in which the vehicle stood still, µs, half-open.

    Parameters
    ----------
    flight : canonical; its arming is read
    gyro, accel : its IMU
    airborne : when it was in the air, µs
    """
    edges = _windows(gyro)
    if len(edges) < 2:
        return ()
    begins, ends = edges[:-1], edges[1:]
    turning, shaking = _Windowed(gyro, edges), _Windowed(accel, edges)
    away = [(start - CLEAR_OF_FLIGHT_US, stop + CLEAR_OF_FLIGHT_US) for start, stop in (*airborne, *_armed(flight))]
    grounded = ~inside((begins + ends) // 2, away) & turning.is_full & shaking.is_full
    still = grounded & (turning.spread > 0.0) & (shaking.spread > 0.0)
    for moved, most in ((turning, MOST_GYRO), (shaking, MOST_ACCEL)):
        still &= moved.spread <= most
        if still.any():
            still &= moved.spread <= QUIET * np.percentile(moved.spread[still], QUIETEST)
    still &= np.linalg.norm(turning.mean, axis=1) <= MOST_TURNING
    tilting = np.linalg.norm(np.diff(shaking.mean, axis=0, prepend=shaking.mean[:1]), axis=1)
    by_chance = _SEVERAL * shaking.spread * np.sqrt(2.0 / np.maximum(shaking.samples, 1.0))
    still &= tilting <= MOST_TILTING + by_chance
    found = intervals_where(begins, still, int(edges[-1]))
    return tuple(one for one in found if one[1] - one[0] >= SHORTEST_S * 1e6)


def _windows(series: SensorSeries) -> npt.NDArray[np.int64]:
    return np.arange(int(series.time[0]), int(series.time[-1]), round(WINDOW_S * 1e6), dtype=np.int64)


class _Windowed:
    """Mean and spread of a series in windows.

    Attributes
    ----------
    mean : (W, axes)
    spread : (W,) root of the mean variance of the axes
    samples : (W,)
    is_full : (W,) whether no gap lies in the window
    """

    def __init__(self, series: SensorSeries, edges: npt.NDArray[np.int64]) -> None:
        bounds = np.searchsorted(series.time, edges)
        counts = np.diff(bounds)
        total = np.concatenate([np.zeros((1, series.values.shape[1])), np.cumsum(series.values, axis=0)])
        self.samples = np.maximum(counts, 1).astype(np.float64)
        self.mean = np.diff(total[bounds], axis=0) / self.samples[:, None]
        inner = series.values[bounds[0] : bounds[-1]] - np.repeat(self.mean, counts, axis=0)
        squares = np.concatenate([[0.0], np.cumsum((inner**2).mean(axis=1))])
        self.spread = np.sqrt(np.diff(squares[bounds - bounds[0]]) / np.maximum(counts - 1.0, 1.0))
        gaps = np.concatenate([[0], np.cumsum(np.diff(series.time) > GAP_STEPS * series.step_s * 1e6)])
        padded = np.append(gaps, gaps[-1])
        self.is_full = (padded[bounds[1:]] == padded[bounds[:-1]]) & (counts >= 2)


def _armed(flight: Flight) -> tuple[Interval, ...]:
    """When the motors may have turned, µs; nothing where the log does not tell."""
    table = flight.topic("vehicle_status")
    if table is None or "arming_state" not in table:
        return ()
    time = np.asarray(table["timestamp"], np.int64)
    return intervals_where(time, np.asarray(table["arming_state"]) == _ARMED, flight.last_timestamp)
