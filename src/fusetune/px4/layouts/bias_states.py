"""The bias states of one estimator instance over a log of any release, as rates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fusetune.px4.flight import Flight, TopicTable, row_count, stacked
from fusetune.px4.layouts.state_layout import UPDATE_INTERVAL_S, state_layout, tells_bias_rates

_GYRO, _ACCEL = slice(10, 13), slice(13, 16)
_FIXED_GYRO_LIMIT, _GYRO_LIMIT_PARAMETER = math.radians(20.0), (1, 14)
"""Up to the release in which EKF2_GYR_B_LIM came."""


@dataclass(frozen=True)
class BiasStates:
    """Biases in body axes.

    Attributes
    ----------
    time : (N,) µs
    gyro, accel : (N, 3) rad/s, m/s²
    interval_s : update interval by which states that are increments were divided, s; 1 where they are rates
    """

    time: np.ndarray
    gyro: np.ndarray
    accel: np.ndarray
    interval_s: float


def bias_states(flight: Flight, instance: int) -> BiasStates | None:
    """Biases from `estimator_states`; None where the log has none, or in the layout of no release.

    Parameters
    ----------
    flight : in the layout of `fusetune.px4.layouts.release_layouts.canonical`
    """
    table, rates = (flight.topic(name, instance) for name in ("estimator_states", "estimator_sensor_bias"))
    layout = None if table is None or not row_count(table) else state_layout(table, rates)
    if table is None or layout is None:
        return None
    states = stacked(table, "states")
    known = np.isfinite(states[:, 10:16]).all(axis=1)
    states, time = states[known], table["timestamp"][known].astype(np.int64)
    if not len(time):
        return None
    interval = 1.0 if layout.has_bias_rates else update_interval_s(flight, time, states, rates)
    return BiasStates(time, states[:, _GYRO] / interval, states[:, _ACCEL] / interval, interval)


def bias_limits(flight: Flight, instance: int, parameters: Mapping[str, float]) -> tuple[float, float]:
    """Largest biases that the estimator of a flight could find along an axis, rad/s and m/s².

    Parameters
    ----------
    parameters : in the names of v1.16, for logs that do not tell the limits themselves
    """
    told = flight.topic("estimator_sensor_bias", instance)
    gyro, accel = (
        float(np.median(told[name])) if told is not None and name in told and row_count(told) else 0.0
        for name in ("gyro_bias_limit", "accel_bias_limit")
    )
    is_fixed = flight.release is not None and flight.release[:2] < _GYRO_LIMIT_PARAMETER
    return (
        gyro or (_FIXED_GYRO_LIMIT if is_fixed else parameters["EKF2_GYR_B_LIM"]),
        accel or parameters["EKF2_ABL_LIM"],
    )


def update_interval_s(flight: Flight, time: np.ndarray, states: np.ndarray, rates: TopicTable | None) -> float:
    """Update interval of an estimator whose bias states are increments, s.

    It is a whole number of IMU intervals near 10 ms: 8 ms with an IMU at 250 Hz. Told by the biases that the log also
    holds as rates, else by the IMU's interval.
    """
    if rates is not None and tells_bias_rates(rates):
        rows = np.clip(np.searchsorted(rates["timestamp"], time), 0, row_count(rates) - 1)
        as_rates = np.hstack([stacked(rates, name)[rows] for name in ("gyro_bias", "accel_bias")])
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = states[:, 10:16] / as_rates
        ratio = ratio[np.isfinite(ratio) & (ratio > 0.0)]
        if ratio.size:
            return float(np.median(ratio))
    combined = flight.topic("sensor_combined")
    if combined is None or "gyro_integral_dt" not in combined or not row_count(combined):
        return UPDATE_INTERVAL_S
    imu = float(np.median(combined["gyro_integral_dt"])) * 1e-6
    return max(round(UPDATE_INTERVAL_S / imu), 1) * imu if imu > 0.0 else UPDATE_INTERVAL_S
