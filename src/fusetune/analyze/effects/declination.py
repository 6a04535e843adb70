"""How far a heading is from the true one, by what GNSS velocities say of the accelerations.

    v_GNSS(t) − v(t) = walk + ε (e_z × v(t)) + …

v is what the accelerometer integrates to with the attitude in question. Where its heading is off by ε, every change of
velocity comes out turned by ε; errors of tilt and of the accelerometer make the difference drift, as a walk.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.effects.gyro_attitude import GyroAttitude
from fusetune.analyze.effects.walking_regression import WalkingRows, fit_walking
from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.ekf2.feed.message_samples import gnss_refusals, gnss_samples, taken
from fusetune.ekf2.numerics.constants import ONE_G

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

_KNOTS_S = 2.0
_FEWEST = 50


@dataclass(frozen=True)
class HeadingError:
    """In degrees, with the half of its 95 % interval; n measurements behind it."""

    value: float
    half_width: float
    standard_error: float
    n: int


def true_heading_error(
    observed: ObservedFlight, heading: GyroAttitude, time: Times, error: Array
) -> HeadingError | None:
    """Of the attitude `heading` with its error (N,), rad, at `time` (N,), µs, taken out; None with too little GNSS."""
    table, steps_of = observed.flight.topic("vehicle_gps_position"), observed.replayed.steps
    if table is None or steps_of is None:
        return None
    steps = steps_of()
    turn = np.interp(steps.time, time, error)
    rotation = heading.rotation_at(steps.time)
    felt = np.einsum(
        "kij,kj->ki", rotation, steps.delta_velocity - steps.accel_bias.mean(axis=0) * steps.delta_velocity_dt[:, None]
    )
    felt[:, 2] += ONE_G * steps.delta_velocity_dt
    cosine, sine = np.cos(turn), np.sin(turn)
    gained = np.column_stack([cosine * felt[:, 0] - sine * felt[:, 1], sine * felt[:, 0] + cosine * felt[:, 1]])
    velocity = np.cumsum(gained, axis=0)
    samples = gnss_samples(table)
    stamp = samples["time_us"] - round(1e3 * observed.parameters.get("EKF2_GPS_DELAY", 0.0))
    usable = taken(table, gnss_refusals(table, observed.flight.release)) & inside(stamp, observed.airborne)
    usable &= np.isfinite(samples["vel"]).all(axis=1) & (stamp < steps.time[-1]) & (stamp > steps.time[0])
    if np.count_nonzero(usable) < _FEWEST:
        return None
    stamp, measured = stamp[usable], samples["vel"][usable][:, :2]
    then = np.column_stack([np.interp(stamp, steps.time, one) for one in velocity.T])
    zero, one = np.zeros(stamp.size), np.ones(stamp.size)
    design = np.concatenate([-then[:, 1], then[:, 0]])[:, None]
    walking = np.vstack([np.column_stack([one, zero]), np.column_stack([zero, one])])
    time_s = np.tile(stamp * 1e-6, 2)
    rows = WalkingRows(time_s, (measured - then).ravel(order="F"), design, walking, np.array([np.inf]), _KNOTS_S)
    fit = fit_walking(rows)
    if fit is None:
        return None
    value, half, error_deg = (math.degrees(one) for one in (fit.constants[0], fit.half_width(0), fit.standard_error[0]))
    return HeadingError(value, half, error_deg, stamp.size)
