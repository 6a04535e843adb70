"""External vision against the motion that IMU and GNSS tell: heading of its frame, scale, delay, noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.diagnosis.lagged_regression import LaggedFit, about_down, lagged_fit, turned_by
from fusetune.analyze.diagnosis.motion import Motion
from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.ekf2.feed.message_samples import vision_samples
from fusetune.px4.flight import Flight

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

FASTEST_HZ = 10.0
FEWEST = 60
LEAST_SPEED_M_S = 0.5
"""A vehicle that hovers moves less than the drift of what its IMU integrates."""


@dataclass(frozen=True)
class VisionSigns:
    """What vision makes of the motion.

    Attributes
    ----------
    fit : delay and its like, of positions, or of velocities where there are none
    scale, scale_error : way of vision over way
    turn, turn_error : heading of vision's frame against north, rad, by the heading of GNSS or, without it, the replay's
    by_gnss : whether it is that of GNSS
    position_noise, velocity_noise : robust white noise of a reading, m and m/s; NaN without
    speed : RMS of the vehicle's level velocity less its mean, m/s
    claimed_position, claimed_velocity : what the messages claim of these, standard deviations; NaN without
    """

    fit: LaggedFit
    scale: float
    scale_error: float
    turn: float
    turn_error: float
    by_gnss: bool
    position_noise: float
    velocity_noise: float
    speed: float
    claimed_position: float
    claimed_velocity: float


def vision_signs(
    flight: Flight,
    motion: Motion,
    airborne: tuple[Interval, ...],
    parameters: Mapping[str, float],
    heading: float,
    by_gnss: bool,
) -> VisionSigns | None:
    """Look at vision; None without it, or where the flight does not tell."""
    table = flight.topic("vehicle_visual_odometry")
    if table is None:
        return None
    samples, _ = vision_samples(table, flight.release)
    time = samples["time_us"].astype(np.int64)
    good = inside(time, airborne) & (time > motion.time[0] + 500_000) & (time < motion.time[-1])
    samples, time = samples[good], time[good]
    by_position = np.isfinite(samples["pos"]).all(axis=1)
    of_position = bool(by_position.sum() > FEWEST)
    used = by_position if of_position else np.isfinite(samples["vel"]).all(axis=1)
    if used.sum() < FEWEST:
        return None
    samples, time = samples[used], time[used]
    noises = [_noise(samples[name]) for name in ("pos", "vel")]
    every = max(1, int(1e6 / (FASTEST_HZ * float(np.median(np.diff(time)))) + 0.5))
    at_time, measured = time[::every], samples["pos" if of_position else "vel"][::every].astype(np.float64)
    step_s = np.diff(motion.time, prepend=motion.time[:1])[:, None] * 1e-6
    way = np.cumsum(motion.free_velocity * step_s, axis=0) if of_position else motion.free_velocity
    rate = motion.free_velocity if of_position else np.gradient(motion.free_velocity, motion.time * 1e-6, axis=0)
    differences = 2 if of_position else 1
    apart = max(1, round(FASTEST_HZ))
    first = 0.0
    slow = np.column_stack(
        [np.interp(at_time, motion.time, column) for column in _in_gyro_frame(motion, of_position).T]
    )
    first = turned_by(slow, measured, apart)
    turn = about_down(first)

    def course(at: Times) -> tuple[Array, Array]:
        moved, faster = motion.at(at, way) @ turn.T, motion.at(at, rate) @ turn.T
        across = np.column_stack([-moved[:, 1], moved[:, 0], np.zeros(at.size)])
        return np.zeros_like(moved), np.stack([-faster, moved, across], axis=2)

    fit = lagged_fit(at_time, measured, course, parameters["EKF2_EV_DELAY"] * 1e-3, differences)
    if fit is None:
        return None
    along, aside = fit.values[:2]
    angle = first + float(np.arctan2(aside, along)) - heading
    claimed_position, claimed_velocity = _claimed(samples)
    return VisionSigns(
        fit,
        float(np.hypot(along, aside)),
        float(fit.errors[0]),
        float(np.arctan2(np.sin(angle), np.cos(angle))),
        float(fit.errors[1] / max(float(np.hypot(along, aside)), 0.1)),
        by_gnss,
        noises[0],
        noises[1],
        float(np.sqrt(np.sum(np.var(motion.at(at_time, motion.velocity)[:, :2], axis=0)))),
        claimed_position,
        claimed_velocity,
    )


def _in_gyro_frame(motion: Motion, of_position: bool) -> Array:
    """Way or velocity of the replay in the frame of the gyros' heading."""
    cosine, sine = np.cos(-motion.heading_off), np.sin(-motion.heading_off)
    velocity = np.column_stack(
        [
            cosine * motion.velocity[:, 0] - sine * motion.velocity[:, 1],
            sine * motion.velocity[:, 0] + cosine * motion.velocity[:, 1],
        ]
    )
    if not of_position:
        return velocity
    return np.asarray(np.cumsum(velocity * np.diff(motion.time, prepend=motion.time[:1])[:, None] * 1e-6, axis=0))


def _noise(values: Array) -> float:
    """White noise of readings (N, 3): third differences leave nothing of the motion."""
    finite = np.isfinite(values).all(axis=1)
    if finite.sum() < FEWEST:
        return float("nan")
    rest = np.diff(values[finite].astype(np.float64), n=3, axis=0)
    return float(np.median(np.abs(rest)) / 0.6745 / np.sqrt(20.0))


def _claimed(samples: np.ndarray) -> list[float]:
    """Standard deviations that the messages claim of position and velocity."""
    claims = []
    for name in ("position_var", "velocity_var"):
        variance = samples[name][np.isfinite(samples[name]) & (samples[name] > 0.0)]
        claims.append(float(np.sqrt(np.median(variance))) if variance.size else float("nan"))
    return claims
