"""Scale of the airspeed sensor (`ASPD_SCALE_n`): measured pressure against ground velocity less the wind.

    s |s| = k² a |a| + b + e

s is the measured airspeed, whose square is the pressure that the sensor measures, with an even noise e and a zero b. a
is the air from ahead: of a fixed wing all of it, as EKF2 has it; of a multicopter, which flies sideways as well, what
comes along the tube. The wind is that of the drag fit with what it may be off by (`DragFit.wind_errors`), or one of its
own: then wind from all sides tells k from it, by circles or legs in opposite directions. What to set is 1/k of the
sensor as it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.effects.drag import WIND_MEMORIES_S, DragFit, fit_drag
from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.told import NO_MOTION, is_fixed_wing, refused, stands_still, told_value
from fusetune.analyze.effects.walking_regression import WalkingFit, WalkingRows, fit_walking
from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.observed.body_motion import BodyMotion
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.ekf2.feed.message_samples import (
    airspeed_refusals,
    airspeed_samples,
    taken,
    validated_airspeed_refusals,
    validated_airspeed_samples,
)

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

LARGEST_ERROR = 0.1
"""Standard error over the scale above which it is not told."""
LEAST_AIRSPEED_M_S = 2.0
"""Of air from ahead, by motion and wind, not by what was measured: its noise must not choose."""
UNKNOWN_WIND_M_S = 15.0
ZERO_M2_S2 = 2.0
"""Standard deviation beforehand of the zero of the pressure, about 1 Pa."""
FASTEST_HZ = 10.0
SCALE, ZERO, OFF = 0, 1, 2
"""Places among the constants: k², b, and from there on what the wind is off by."""
_FEWEST = 50
_ROUNDS, _REFINED = 6, 2
_KNOTS_S = 1.0
_WHAT_TO_FLY = "fly two full circles, or the same leg there and back, at cruise speed and constant height"


@dataclass(frozen=True)
class _Air:
    """Air at the tube at N times.

    Attributes
    ----------
    time_s : (N,)
    squared : (N,) s |s|, m²/s²
    forward : (N, 3) the body's forward axis, NED
    velocity : (N, 3) less the wind as it is taken for, NED, m/s
    wind_errors : (N, 2, Q) how the wind may be off, each course times a normal number of its own
    is_along : whether only air along the tube counts
    """

    time_s: Array
    squared: Array
    forward: Array
    velocity: Array
    wind_errors: Array
    is_along: bool

    def rows(self, used: npt.NDArray[np.bool_]) -> _Air:
        """Some of the times."""
        return _Air(
            self.time_s[used],
            self.squared[used],
            self.forward[used],
            self.velocity[used],
            self.wind_errors[used],
            self.is_along,
        )

    def ahead(self, off: Array, gusts: Array) -> tuple[Array, Array]:
        """Air from ahead, (N,) m/s, and how it changes with the wind, (N, 2)."""
        through = self.velocity.copy()
        through[:, :2] -= self.wind_errors @ off + gusts
        if self.is_along:
            return np.einsum("nj,nj->n", self.forward, through), -self.forward[:, :2]
        length = np.maximum(np.linalg.norm(through, axis=1), 0.5)
        return length, -through[:, :2] / length[:, None]


def estimate_airspeed_scale(observed: ObservedFlight, drag: DragFit | str | None = None) -> Effect:
    """Scale of the airspeed sensor that the log holds.

    Parameters
    ----------
    drag : by `drag.fit_drag`, where it is at hand
    """
    name, motion = "airspeed_scale", observed.motion
    found = _measured(observed)
    if motion is None or found is None:
        return refused(name, NO_MOTION if motion is None else "the log has no airspeed")
    time, speed, is_raw = found
    used = inside(time, observed.airborne) & motion.covers(time)
    time, speed = time[used], speed[used]
    if time.size < _FEWEST:
        return refused(name, f"too few airspeeds in the air; {_WHAT_TO_FLY}")
    if stands_still(speed):
        return refused(name, "the airspeed sensor repeats one value")
    every = max(1, round(1.0 / (FASTEST_HZ * max(float(np.median(np.diff(time))) * 1e-6, 1e-3))))
    time, speed = time[::every], speed[::every]
    drag = fit_drag(observed) if drag is None else drag
    fit = _gauss_newton(_air(observed, motion, time, speed, drag))
    if fit is None:
        return refused(name, f"too short a time with air from ahead; {_WHAT_TO_FLY}")
    figures = {"wind_known": float(isinstance(drag, DragFit)), "residual_m2_s2": float(np.std(fit.residual))}
    squared, half, error = float(fit.constants[SCALE]), fit.half_width(SCALE), float(fit.standard_error[SCALE])
    if squared <= 0.0 or error > 2.0 * LARGEST_ERROR * squared or half >= squared:
        return refused(name, f"scale and wind are one where the course hardly changes; {_WHAT_TO_FLY}", **figures)
    told = told_value(observed.logged.parameters.initial, "ASPD_SCALE_1")
    unit = 1.0 if is_raw or told is None else told
    value, lower, upper = (unit / math.sqrt(one) for one in (squared, squared + half, squared - half))
    scale = Estimate("ASPD_SCALE_1", "", told, value, lower, upper, 0.5 * value * error / squared, fit.residual.size)
    return Effect(name, (scale,), "", figures)


def _air(observed: ObservedFlight, motion: BodyMotion, time: Times, speed: Array, drag: DragFit | str) -> _Air:
    time_s, velocity = np.asarray(time * 1e-6, np.float64), motion.velocity_at(time)
    if isinstance(drag, DragFit):
        wind, errors = drag.wind(time_s), drag.wind_errors(time_s)
    else:
        wind = _first_wind(speed, velocity)
        errors = np.broadcast_to(UNKNOWN_WIND_M_S * np.eye(2), (time.size, 2, 2))
    velocity[:, :2] -= wind
    forward = motion.rotation_at(time)[:, :, 0]
    return _Air(time_s, speed * np.abs(speed), forward, velocity, errors, not is_fixed_wing(observed))


def _measured(observed: ObservedFlight) -> tuple[Times, Array, bool] | None:
    """Times of measurement, µs, true airspeed, m/s, and whether it is before the scale; None without any."""
    delay_us = round(1e3 * observed.parameters.get("EKF2_ASP_DELAY", 0.0))
    table = observed.flight.topic("airspeed")
    if table is not None:
        samples, usable = airspeed_samples(table, 1.0), taken(table, airspeed_refusals(table))
    else:
        table = observed.flight.topic("airspeed_validated")
        if table is None:
            return None
        samples = validated_airspeed_samples(table)
        usable = taken(table, validated_airspeed_refusals(table, observed.flight.release))
    speed = np.asarray(samples["true_airspeed"], np.float64)
    usable &= np.isfinite(speed)
    raw = observed.flight.topic("airspeed") is not None
    return (samples["time_us"][usable] - delay_us, speed[usable], raw) if np.count_nonzero(usable) > 2 else None


def _gauss_newton(air: _Air) -> WalkingFit | None:
    still = air.ahead(np.zeros(air.wind_errors.shape[2]), np.zeros((air.time_s.size, 2)))[0]
    air = air.rows(still > LEAST_AIRSPEED_M_S)
    if air.time_s.size < _FEWEST:
        return None
    courses = air.wind_errors.shape[2]
    expected = np.array([np.inf, ZERO_M2_S2, *[1.0] * courses])
    squared, off, gusts = 1.0, np.zeros(courses), np.zeros((air.time_s.size, 2))
    fit: WalkingFit | None = None
    for number in range(_ROUNDS):
        ahead, slope = air.ahead(off, gusts)
        by_wind = 2.0 * squared * np.abs(ahead)[:, None] * slope
        by_off = np.einsum("nw,nwq->nq", by_wind, air.wind_errors)
        design = np.column_stack([ahead * np.abs(ahead), np.ones(ahead.size), by_off])
        target = air.squared + by_off @ off + np.sum(by_wind * gusts, axis=1)
        rows = WalkingRows(air.time_s, target, design, by_wind, expected, _KNOTS_S, WIND_MEMORIES_S)
        fit = fit_walking(rows, fit, refined=number == _REFINED)
        if fit is None:
            return None
        squared = float(np.clip(fit.constants[SCALE], 0.1, 10.0))
        off = fit.constants[OFF:]
        gusts = np.column_stack([np.interp(air.time_s, fit.knot_s, one) for one in fit.course.T])
    return fit


def _first_wind(speed: Array, velocity: Array) -> Array:
    """The wind that fits |v − w|² = s² / k² best, which is linear in it, its square, and 1/k²."""
    design = np.column_stack([-2.0 * velocity[:, :2], np.ones(speed.size), -np.square(speed)])
    found = np.linalg.lstsq(design, -np.sum(np.square(velocity), axis=1), rcond=None)[0]
    return np.asarray(np.clip(found[:2], -20.0, 20.0))
