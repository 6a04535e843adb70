"""Optical flow against the motion over the ground: scale, turn, delay, and whether its gyro tells how it turns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.delays.delayed_series import flow_series
from fusetune.analyze.delays.inertial_motion import inertial_motion
from fusetune.analyze.diagnosis.lagged_regression import LaggedFit, lagged_fit
from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.replaying.replayed_set import FilterStates
from fusetune.px4.flight import Flight

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

FASTEST_HZ = 20.0


@dataclass(frozen=True)
class FlowSigns:
    """What the flow makes of the motion.

    Attributes
    ----------
    fit : delay and its like
    scale, scale_error : flow over what the motion makes
    turn, turn_error : of the flow against the body about the down axis, rad
    rotation, rotation_error : (2,) share of the body's own turning that is left in the flow after its gyro's is taken
        out
    """

    fit: LaggedFit
    scale: float
    scale_error: float
    turn: float
    turn_error: float
    rotation: Array
    rotation_error: Array


def flow_signs(
    flight: Flight, states: FilterStates, airborne: tuple[Interval, ...], parameters: Mapping[str, float]
) -> FlowSigns | None:
    """Look at the flow; None without flow and range, or where the flight does not tell."""
    imu = flight.topic("sensor_combined")
    if imu is None or flight.topic("vehicle_optical_flow") is None:
        return None
    motion = inertial_motion(imu, states)
    series = flow_series(flight, motion, parameters) if motion is not None else None
    if motion is None or series is None:
        return None
    told_s = parameters["EKF2_OF_DELAY"] * 1e-3
    usable = inside(series.time - round(told_s * 1e6), airborne) & (series.time > motion.time[0] + 500_000)
    series = series.rows(usable & (series.time < motion.time[-1]))
    if series.time.size < 60:
        return None
    every = max(1, int(1e6 / (FASTEST_HZ * float(np.median(np.diff(series.time)))) + 0.5))
    time, measured = series.time[::every], series.measured[::every]
    seconds = motion.time * 1e-6
    rates = motion.body_rate[:, :2]

    def looked_up(at: Times, values: Array) -> Array:
        return np.column_stack([np.interp(at * 1e-6, seconds, column) for column in values.T])

    def course(at: Times) -> tuple[Array, Array]:
        sight, rate = looked_up(at, series.motion), looked_up(at, rates)
        later = (looked_up(at - 40_000, series.motion) - looked_up(at + 40_000, series.motion)) / 0.08
        across = np.column_stack([-sight[:, 1], sight[:, 0]])
        own = np.zeros((at.size, 2, 3))
        own[:, range(2), range(2)] = rate
        # flow that is turned shows the turning about one axis as one about the other
        own[:, 0, 2], own[:, 1, 2] = rate[:, 1], -rate[:, 0]
        return np.zeros_like(sight), np.concatenate(
            [later[:, :, None], sight[:, :, None], across[:, :, None], own], axis=2
        )

    fit = lagged_fit(time, measured, course, told_s, 1)
    if fit is None:
        return None
    along, across = fit.values[:2]
    scale = float(np.hypot(along, across))
    by_way = float(np.arctan2(across, along)), float(fit.errors[1] / max(scale, 0.1))
    own, own_error = fit.values[2:4], fit.errors[2:4]
    turned = 1.0 - float(np.average(own, weights=own_error**-2.0))
    size = max(float(np.hypot(fit.values[4], turned)), 0.1)
    by_turning = float(np.arctan2(fit.values[4], turned)), float(fit.errors[4] / size)
    tells = turned > LEAST_TURNED and by_turning[1] < LARGEST_TURN_ERROR_RAD
    turn, turn_error = by_turning if tells else by_way
    return FlowSigns(fit, scale, float(fit.errors[0]), turn, turn_error, own, own_error)


LEAST_TURNED = 0.3
"""With less of the turning in the flow, as of a gyro that does not tell it, its direction says nothing."""
LARGEST_TURN_ERROR_RAD = np.radians(8.0)
"""Where turning tells the direction as well as this it is believed, and not the way: a filter that uses the flow is led
along by it, and its way with it, gyros are not."""
