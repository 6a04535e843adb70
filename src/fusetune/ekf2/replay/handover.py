"""Another estimator instance becomes the primary one: its sensors come with what it had learned of them.

A flight of several instances is replayed by one filter, on the sensors of the instance that was primary at the time.
The biases of one IMU are not those of the next, which the vehicle's new primary instance had known for long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fusetune.ekf2.feed.inputs import BIAS_RESETS, EstimatorInputs, without_arrivals
from fusetune.ekf2.filter.common.state import ACCEL_BIAS, GYRO_BIAS, MAG_BODY, MAG_EARTH
from fusetune.ekf2.replay.older_start import bias_unit
from fusetune.ekf2.replay.warm_start import MIN_VARIANCES, knows_field
from fusetune.px4.layouts.logged_state import Handover, LoggedState

SAME_CHANGE_US = 2_000_000
"""The topics that tell of another device may come that much before or after."""


def handover_runs(
    inputs: EstimatorInputs, lag_ms: float, handovers: Sequence[Handover]
) -> list[tuple[int, LoggedState]]:
    """Runs at which the horizon, `lag_ms` behind the newest sample, comes to the new sensors."""
    lag_us = round(lag_ms * 1e3)
    times = inputs.arrays.imu["time_us"]
    return [(int(np.searchsorted(times, one.time_us + lag_us)), one.state) for one in handovers]


def without_resets_at(inputs: EstimatorInputs, handovers: Sequence[Handover]) -> EstimatorInputs:
    """The same inputs, but for what the filter would forget of its sensors on seeing another device."""
    if not handovers:
        return inputs
    arrays = inputs.arrays
    mag, arrivals = arrays.mag.copy(), arrays.arrivals
    for one in handovers:
        mag["reset"][np.abs(mag["time_us"] - one.time_us) < SAME_CHANGE_US] = False
        near = np.abs(arrays.imu["time_us"] - one.time_us) < SAME_CHANGE_US
        arrivals = without_arrivals(arrivals, BIAS_RESETS, near)
    return replace(inputs, arrays=arrays._replace(mag=mag, arrivals=arrivals))


def take_sensor_states(ekf: np.void, state: LoggedState) -> None:
    """Take over biases and field, and their variances; attitude, velocity and position stay the filter's own.

    Parameters
    ----------
    ekf : EKF record, changed in place
    state : of the instance that is primary from now on
    """
    if not ekf["filter_initialised"]:
        return
    unit, estimates_field = bias_unit(ekf), ekf["cs"]["mag"] or ekf["cs"]["mag_3d"]
    blocks = {"gyro_bias": (GYRO_BIAS, unit * state.gyro_bias), "accel_bias": (ACCEL_BIAS, unit * state.accel_bias)}
    if estimates_field and knows_field(state):
        blocks |= {"mag_I": (MAG_EARTH, state.mag_earth), "mag_B": (MAG_BODY, state.mag_body)}
    for name, (first, value) in blocks.items():
        ekf[name] = value
        rows = np.arange(first, first + 3)
        ekf["P"][rows, :] = 0.0
        ekf["P"][:, rows] = 0.0
        variances = np.maximum(state.variances[rows], MIN_VARIANCES.get(name, 0.0))
        ekf["P"][rows, rows] = variances if name.startswith("mag") else unit * unit * variances
