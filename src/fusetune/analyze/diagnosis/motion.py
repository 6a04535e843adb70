"""How the vehicle moved, as the gyros and the level of a replay tell: its heading owes nothing to the magnetometer.

The replay's own heading follows the magnetometer, and so hides what is wrong with it. Here the heading is the integral
of the gyros from where the replay had it first; what that drifts off by, and by what it was off from the start, the
regressions that use it estimate along with everything else. The tilt is the replay's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.flight.throttle import throttle
from fusetune.analyze.replaying.replayed_set import ReplayedSet, ReplayedSteps
from fusetune.ekf2.numerics.constants import ONE_G
from fusetune.px4.flight import Flight
from fusetune.quaternions import rotation_matrix

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

THRUST_OVER_S = 0.25
"""The thrust is smoothed over so long: vibration is no thrust."""


@dataclass(frozen=True)
class Motion:
    """Motion at every update of a replay; N rows in order of time.

    Attributes
    ----------
    time : (N,) on the fusion horizon, µs
    rotation : (N, 3, 3) body → an earth frame whose heading is that of the gyros
    heading_off : (N,) the replay's heading less that of the gyros, rad
    velocity : (N, 3) of the replay, NED, m/s
    free_velocity : (N, 3) integrated from the IMU in the earth frame of `rotation`, m/s; drifts
    body_rate : (N, 3) rad/s, FRD
    force : (N, 3) specific force as measured, m/s², FRD
    height : (N,) above where the replay took off, m
    thrust : (N,) about 1 in a hover, 0 on the ground: of the log where it has it, else of the specific force
    thrust_source : what the thrust was taken from
    """

    time: Times
    rotation: Array
    heading_off: Array
    velocity: Array
    free_velocity: Array
    body_rate: Array
    force: Array
    height: Array
    thrust: Array
    thrust_source: str

    def at(self, when: Times, values: Array) -> Array:
        """Columns of the motion at other times, linearly; (M, …) for (N, …)."""
        flat = values.reshape(values.shape[0], -1)
        found = np.column_stack([np.interp(when, self.time, column) for column in flat.T])
        return found.reshape(when.size, *values.shape[1:])

    @property
    def swept(self) -> Array:
        """(N, 3, 3) velocity, m/s in the earth frame, of points one metre along each axis of the body."""
        across = np.cross(self.body_rate[:, None, :], np.eye(3)).swapaxes(1, 2)
        return np.asarray(self.rotation @ across)

    def air_velocity(self, wind: Array | None = None) -> Array:
        """(N, 3) velocity through the air along the axes of the body, m/s.

        Parameters
        ----------
        wind : (N, 2) north and east, m/s; over the ground where it is not known
        """
        velocity = self.velocity
        if wind is not None:
            velocity = velocity - np.column_stack([wind, np.zeros(self.time.size)])
        # the replay's velocity is in its own frame, which is off from that of the gyros
        turned = _about_down(velocity, -self.heading_off)
        return np.einsum("nji,nj->ni", self.rotation, turned)


def _about_down(vectors: Array, angle: Array) -> Array:
    """Vectors (N, 3) turned about the vertical, each by its angle."""
    cosine, sine = np.cos(angle), np.sin(angle)
    north, east = vectors[:, 0], vectors[:, 1]
    return np.column_stack([cosine * north - sine * east, sine * north + cosine * east, vectors[:, 2]])


_AT_ONCE = 1 << 14
"""Updates that are turned at a time: of an hour the matrices of all would be tens of megabytes."""


def motion_of(record: ReplayedSet, flight: Flight, airborne: tuple[Interval, ...]) -> Motion | None:
    """Motion of a replay; None where it has no steps, or none in the air."""
    if record.steps is None or not airborne:
        return None
    steps = record.steps()
    if steps.time.size < 100 or not np.isfinite(steps.quaternion).all() or not inside(steps.time, airborne).any():
        return None
    step_s = np.maximum(steps.delta_angle_dt, 1e-4)[:, None]
    rate = steps.delta_angle / step_s
    force = steps.delta_velocity / np.maximum(steps.delta_velocity_dt, 1e-4)[:, None]
    turned_by = rotation_matrix(steps.quaternion)
    rate = rate - _gyro_bias(steps, airborne)
    off = _heading_off(steps, turned_by, rate)
    rotation = turned_by
    for start in range(0, len(off), _AT_ONCE):
        some = slice(start, start + _AT_ONCE)
        rotation[some] = np.einsum("nij,njk->nik", _turn(-off[some]), turned_by[some])
    gained = np.einsum("nij,nj->ni", rotation, force) + np.array([0.0, 0.0, ONE_G])
    height = _height(steps, airborne)
    thrust, source = _thrust(flight, steps.time, force, airborne)
    return Motion(
        steps.time,
        rotation,
        off,
        steps.velocity,
        np.cumsum(gained * step_s, axis=0),
        rate,
        force,
        height,
        thrust,
        source,
    )


def _gyro_bias(steps: ReplayedSteps, airborne: tuple[Interval, ...]) -> Array:
    """(3,) median of the estimated bias in the air, rad/s."""
    return np.asarray(np.median(steps.gyro_bias[inside(steps.time, airborne)], axis=0))


def _turn(angle: Array) -> Array:
    """Rotations (N, 3, 3) about the vertical."""
    cosine, sine, nothing, one = np.cos(angle), np.sin(angle), np.zeros(angle.size), np.ones(angle.size)
    rows = [[cosine, -sine, nothing], [sine, cosine, nothing], [nothing, nothing, one]]
    return np.moveaxis(np.array(rows), -1, 0)


def _heading_off(steps: ReplayedSteps, rotation: Array, rate: Array) -> Array:
    """The replay's heading less the integral of the gyros, from 0 at the first row, rad, (N,)."""
    heading = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    roll = np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2])
    cosine_pitch = np.maximum(np.hypot(rotation[:, 2, 1], rotation[:, 2, 2]), 0.1)
    # rate of the heading from body rates (Euler's kinematic equation)
    turning = (np.sin(roll) * rate[:, 1] + np.cos(roll) * rate[:, 2]) / cosine_pitch
    by_gyro = np.cumsum(turning * np.diff(steps.time, prepend=steps.time[:1]) * 1e-6)
    return np.asarray(np.unwrap(heading - heading[0] - by_gyro))


def _height(steps: ReplayedSteps, airborne: tuple[Interval, ...]) -> Array:
    """Integrated vertical velocity, 0 where the vehicle took off and, evenly corrected, where it landed.

    The replay's own height follows the barometer, whose errors it is to be held against.
    """
    climbed = climbed_by(steps.time, steps.velocity)
    ends = np.array([airborne[0][0], airborne[-1][1]], np.float64)
    at_ends = np.interp(ends, steps.time, climbed)
    # a log may end in the air
    landed = steps.time[-1] > ends[1] + LANDED_AFTER_US
    ground = np.interp(steps.time, ends, at_ends if landed else [at_ends[0], at_ends[0]])
    return np.asarray(climbed - ground)


LANDED_AFTER_US = 500_000


def climbed_by(time: Times, velocity: Array) -> Array:
    """(N,) integral of a velocity's way up, (N, 3), NED, m."""
    return np.asarray(-np.cumsum(velocity[:, 2] * np.diff(time, prepend=time[:1]) * 1e-6))


def _thrust(flight: Flight, time: Times, force: Array, airborne: tuple[Interval, ...]) -> tuple[Array, str]:
    """Thrust, about 1 in a hover: of setpoints where the log has them, else what the accelerometer feels of it."""
    in_air = inside(time, airborne)
    asked = throttle(flight)
    if asked is not None:
        values = np.interp(time, asked.time, asked.share)
        usual = float(np.median(values[in_air]))
        if usual > 0.02 and float(np.ptp(values[in_air])) > 0.0:
            return values / usual, asked.topic
    width = max(1, round(THRUST_OVER_S / max(float(np.median(np.diff(time))) * 1e-6, 1e-3)))
    felt = np.convolve(-force[:, 2] / ONE_G, np.full(width, 1.0 / width), mode="same")
    return np.where(in_air, felt, 0.0), "sensor_combined"
