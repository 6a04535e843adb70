"""What each sensor with a delay measured, beside the motion that it measured.

The messages are taken as the log has them, not as a replay used them: the delay that a replay is told does not act on
them, and those that it dropped are there.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from fusetune.analyze.delays.inertial_motion import InertialMotion
from fusetune.analyze.delays.lag import LaggedSeries
from fusetune.ekf2.feed.message_samples import (
    airspeed_refusals,
    airspeed_samples,
    flow_refusals,
    flow_samples,
    range_refusals,
    range_samples,
    taken,
    validated_airspeed_refusals,
    validated_airspeed_samples,
    vision_samples,
)
from fusetune.ekf2.feed.sensor_samples import EV_FRAME_FRD, EV_FRAME_NED
from fusetune.px4.flight import Flight

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

_HEADING_OVER_S = 1.0
_FEWEST_STEPS = 5
_LEAST_DISTANCE_M = 0.1


def vision_series(flight: Flight, motion: InertialMotion, parameters: Mapping[str, float]) -> LaggedSeries | None:
    """Position of the vehicle in the frame of the vision system or, without positions, its velocity there."""
    table = flight.topic("vehicle_visual_odometry")
    if table is None:
        return None
    samples, _ = vision_samples(table, flight.release)
    known = np.isin(samples["pos_frame"], (EV_FRAME_NED, EV_FRAME_FRD)) & np.isfinite(samples["pos"]).all(axis=1)
    if known.any():
        time, measured = samples["time_us"][known], samples["pos"][known]
        moved, arms, differences = motion.travelled, motion.rotation, 2
    else:
        known = np.isin(samples["vel_frame"], (EV_FRAME_NED, EV_FRAME_FRD)) & np.isfinite(samples["vel"]).all(axis=1)
        time, measured = samples["time_us"][known], samples["vel"][known]
        moved, arms, differences = motion.velocity, motion.swept, 1
    if time.size < 3:
        return None
    arm = np.array([parameters[f"EKF2_EV_POS_{axis}"] - parameters[f"EKF2_IMU_POS_{axis}"] for axis in "XYZ"])
    turn = _heading(time, measured, motion.time, moved)
    return LaggedSeries(time, measured, motion.time, (moved + arms @ arm) @ turn.T, differences, True, turn @ arms)


def _heading(time: Times, measured: Array, motion_time: Times, motion: Array) -> Array:
    """Rotation (3, 3) from NED into the frame of the measurement, whose heading is its own: the one that fits best."""
    grid = np.arange(max(time[0], motion_time[0]), min(time[-1], motion_time[-1]), _HEADING_OVER_S * 1e6)
    if grid.size < _FEWEST_STEPS:
        return np.eye(3)
    # second differences, which the drift of the motion does not rule
    one, other = (
        np.diff(np.column_stack([np.interp(grid, when, column) for column in values[:, :2].T]), n=2, axis=0)
        for when, values in ((time, measured), (motion_time, motion))
    )
    angle = np.arctan2(np.sum(other[:, 0] * one[:, 1] - other[:, 1] * one[:, 0]), np.sum(one * other))
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def measured_distances(flight: Flight) -> tuple[Times, Array] | None:
    """Times and distances of the range finder that looks down."""
    for instance in range(4):
        table = flight.topics.get(("distance_sensor", instance))
        if table is None:
            continue
        samples, limits = range_samples(table)
        distance = samples["range"]
        usable = taken(table, range_refusals(table)) & np.isfinite(distance) & (samples["quality"] != 0)
        usable &= ~(distance <= limits[:, 0]) & ~(distance >= limits[:, 1])
        if np.count_nonzero(usable) > 2:
            return samples["time_us"][usable], distance[usable]
    return None


def range_series(flight: Flight, motion: InertialMotion, parameters: Mapping[str, float]) -> LaggedSeries | None:
    """Height above ground."""
    found = measured_distances(flight)
    if found is None:
        return None
    time, distance = found
    upright = motion.rotation[:, 2, 2]
    told_us = round(parameters["EKF2_RNG_DELAY"] * 1e3)
    height = distance * np.interp(time - told_us, motion.time, upright)
    return LaggedSeries(time, height[:, None], motion.time, -motion.travelled[:, 2:], differences=2)


def flow_series(flight: Flight, motion: InertialMotion, parameters: Mapping[str, float]) -> LaggedSeries | None:
    """Rate of the line of sight without the vehicle's own turning, rad/s."""
    table, ranged = flight.topic("vehicle_optical_flow"), measured_distances(flight)
    if table is None or ranged is None:
        return None
    samples, _ = flow_samples(table)
    usable = taken(table, flow_refusals(table)) & np.isfinite(samples["gyro_rate"]).all(axis=1)
    usable &= samples["quality"] > parameters["EKF2_OF_QMIN"]
    measured = (samples["flow_rate"] - samples["gyro_rate"][:, :2])[usable]
    body = np.einsum("nji,nj->ni", motion.rotation, motion.bounded_velocity)
    distance = np.interp(motion.time, *ranged)
    sight = np.column_stack([body[:, 1], -body[:, 0]]) / np.maximum(distance, _LEAST_DISTANCE_M)[:, None]
    return LaggedSeries(samples["time_us"][usable], measured, motion.time, sight)


def measured_airspeed(flight: Flight) -> tuple[Times, Array] | None:
    """Times, µs, and true airspeeds, m/s, that the estimator is given, without a scale of its own; None without any."""
    table = flight.topic("airspeed_validated")
    if table is not None:
        samples = validated_airspeed_samples(table)
        usable = taken(table, validated_airspeed_refusals(table, flight.release))
    else:
        table = flight.topic("airspeed")
        if table is None:
            return None
        samples, usable = airspeed_samples(table, 1.0), taken(table, airspeed_refusals(table))
    return samples["time_us"][usable], samples["true_airspeed"][usable]


def airspeed_series(flight: Flight, motion: InertialMotion, parameters: Mapping[str, float]) -> LaggedSeries | None:
    """True airspeed, against the speed through the wind that fits best."""
    measured = measured_airspeed(flight)
    if measured is None:
        return None
    time, speed = measured
    inside = (time > motion.time[0]) & (time < motion.time[-1]) & (speed > 0.0)
    time, speed = time[inside], speed[inside]
    if time.size < 10:
        return None
    velocity = motion.bounded_velocity
    then = np.column_stack([np.interp(time, motion.time, column) for column in velocity.T])
    # |v − w|² = s² is linear in the wind w and its square
    design = np.column_stack([-2.0 * then[:, :2], np.ones(time.size)])
    wind = np.linalg.lstsq(design, speed**2 - np.sum(then**2, axis=1), rcond=None)[0][:2]
    through = np.hypot(np.hypot(velocity[:, 0] - wind[0], velocity[:, 1] - wind[1]), velocity[:, 2])
    return LaggedSeries(time, speed[:, None], motion.time, through[:, None])
