"""What each sensor with a delay measured, beside the motion that it measured.

The messages are taken as the log has them, not as a replay used them: the delay that a replay is told does not act on
them, and those that it dropped are there.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from fusetune.analyze.sensors.inertial_motion import InertialMotion
from fusetune.analyze.sensors.lag import LaggedSeries
from fusetune.ekf2.feed.message_samples import (
    airspeed_refusals,
    airspeed_samples,
    flow_refusals,
    flow_samples,
    gnss_refusals,
    gnss_samples,
    range_refusals,
    range_samples,
    taken,
    validated_airspeed_refusals,
    validated_airspeed_samples,
    vision_refusals,
    vision_samples,
)
from fusetune.ekf2.feed.sensor_samples import EV_FRAME_FRD, EV_FRAME_NED
from fusetune.px4.flight import Flight

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

FIX_3D = 3
_HEADING_OVER_S = 1.0


def gnss_series(flight: Flight, motion: InertialMotion, parameters: Mapping[str, float]) -> LaggedSeries | None:
    """Velocity of the antenna, NED."""
    table = flight.topic("vehicle_gps_position")
    if table is None:
        return None
    samples = gnss_samples(table)
    usable = taken(table, gnss_refusals(table, flight.release)) & (samples["fix_type"] >= FIX_3D)
    usable &= np.isfinite(samples["vel"]).all(axis=1)
    arm = _arm(parameters, "GPS")
    swept = np.einsum("nij,njk->nik", motion.rotation, np.cross(motion.body_rate[:, None, :], np.eye(3)).swapaxes(1, 2))
    velocity = motion.velocity + swept @ arm
    time, measured = samples["time_us"][usable], samples["vel"][usable]
    return LaggedSeries(time, measured, motion.time, velocity, turns=True, arms=swept)


def _arm(parameters: Mapping[str, float], sensor: str) -> Array:
    """From the IMU to the sensor, FRD m."""
    return np.array([parameters[f"EKF2_{sensor}_POS_{axis}"] - parameters[f"EKF2_IMU_POS_{axis}"] for axis in "XYZ"])


def vision_series(flight: Flight, motion: InertialMotion, parameters: Mapping[str, float]) -> LaggedSeries | None:
    """Position of the vehicle in the frame of the vision system or, without positions, its velocity there."""
    table = flight.topic("vehicle_visual_odometry")
    if table is None:
        return None
    samples, _ = vision_samples(table, flight.release)
    known = np.isin(samples["pos_frame"], (EV_FRAME_NED, EV_FRAME_FRD)) & np.isfinite(samples["pos"]).all(axis=1)
    if known.any():
        time, measured, moved, differences = samples["time_us"][known], samples["pos"][known], motion.travelled, 2
    else:
        known = np.isin(samples["vel_frame"], (EV_FRAME_NED, EV_FRAME_FRD)) & np.isfinite(samples["vel"]).all(axis=1)
        time, measured, moved, differences = samples["time_us"][known], samples["vel"][known], motion.velocity, 1
    if np.count_nonzero(known) < 3:
        return None
    return LaggedSeries(time, measured, motion.time, _turned(time, measured, motion.time, moved), differences, True)


def _turned(time: Times, measured: Array, motion_time: Times, motion: Array) -> Array:
    """The motion in the frame of the measurement, whose heading is its own: the one that fits what changed best."""
    grid = np.arange(max(time[0], motion_time[0]), min(time[-1], motion_time[-1]), _HEADING_OVER_S * 1e6)
    if grid.size < 3:
        return motion
    one, other = (
        np.diff(np.column_stack([np.interp(grid, when, column) for column in values[:, :2].T]), n=2, axis=0)
        for when, values in ((time, measured), (motion_time, motion))
    )
    angle = np.arctan2(np.sum(other[:, 0] * one[:, 1] - other[:, 1] * one[:, 0]), np.sum(one * other))
    turned = motion.copy()
    turned[:, 0] = np.cos(angle) * motion[:, 0] - np.sin(angle) * motion[:, 1]
    turned[:, 1] = np.sin(angle) * motion[:, 0] + np.cos(angle) * motion[:, 1]
    return turned


def _range(flight: Flight) -> tuple[Times, Array] | None:
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
    found = _range(flight)
    if found is None:
        return None
    time, distance = found
    upright = motion.rotation[:, 2, 2]
    told_us = round(parameters["EKF2_RNG_DELAY"] * 1e3)
    height = distance * np.interp(time - told_us, motion.time, upright)
    return LaggedSeries(time, height[:, None], motion.time, -motion.travelled[:, 2:], differences=2)


def flow_series(flight: Flight, motion: InertialMotion, parameters: Mapping[str, float]) -> LaggedSeries | None:
    """Rate of the line of sight without the vehicle's own turning, rad/s."""
    table, ranged = flight.topic("vehicle_optical_flow"), _range(flight)
    if table is None or ranged is None:
        return None
    samples, _ = flow_samples(table)
    usable = taken(table, flow_refusals(table)) & np.isfinite(samples["gyro_rate"]).all(axis=1)
    usable &= samples["quality"] > parameters["EKF2_OF_QMIN"]
    measured = (samples["flow_rate"] - samples["gyro_rate"][:, :2])[usable]
    body = np.einsum("nji,nj->ni", motion.rotation, motion.bounded_velocity)
    distance = np.interp(motion.time, *ranged)
    sight = np.column_stack([body[:, 1], -body[:, 0]]) / np.maximum(distance, 0.1)[:, None]
    return LaggedSeries(samples["time_us"][usable], measured, motion.time, sight)


def airspeed_series(flight: Flight, motion: InertialMotion, parameters: Mapping[str, float]) -> LaggedSeries | None:
    """True airspeed, against the speed through the wind that fits best."""
    table = flight.topic("airspeed_validated")
    if table is not None:
        samples, usable = validated_airspeed_samples(table), taken(table, validated_airspeed_refusals(table, flight.release))
    else:
        table = flight.topic("airspeed")
        if table is None:
            return None
        samples, usable = airspeed_samples(table, 1.0), taken(table, airspeed_refusals(table))
    time, speed = samples["time_us"][usable], samples["true_airspeed"][usable]
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
