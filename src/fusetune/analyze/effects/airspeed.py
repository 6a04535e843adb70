"""Scale of the airspeed sensor (`ASPD_SCALE_n`): measured airspeed against ground velocity less a wind of its own.

    airspeed = k |v − w(t)| + e

Wind from all sides tells k from w: circles, or legs in opposite directions. What to set is 1/k of the sensor as it is.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fusetune.analyze.effects.drag import WIND_MEMORIES_S
from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.told import NO_MOTION, refused, stands_still, told_value
from fusetune.analyze.effects.walking_regression import WalkingFit, WalkingRows, fit_walking
from fusetune.analyze.flight.intervals import inside
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
EXPECTED = np.array([np.inf, 15.0, 15.0])
FASTEST_HZ = 10.0
_FEWEST = 50
_ROUNDS, _REFINED = 5, 2
_KNOTS_S = 1.0
_WHAT_TO_FLY = "fly two full circles, or the same leg there and back, at cruise speed and constant height"


def estimate_airspeed_scale(observed: ObservedFlight) -> Effect:
    """Scale of the airspeed sensor that the log holds."""
    name, motion = "airspeed_scale", observed.motion
    found = _measured(observed)
    if motion is None or found is None:
        return refused(name, NO_MOTION if motion is None else "the log has no airspeed")
    time, speed, is_raw = found
    used = inside(time, observed.airborne) & motion.covers(time) & (speed > LEAST_AIRSPEED_M_S)
    time, speed = time[used], speed[used]
    if time.size < _FEWEST:
        return refused(name, f"too few airspeeds in the air; {_WHAT_TO_FLY}")
    if stands_still(speed):
        return refused(name, "the airspeed sensor repeats one value")
    every = max(1, round(1.0 / (FASTEST_HZ * max(float(np.median(np.diff(time))) * 1e-6, 1e-3))))
    time, speed = time[::every], speed[::every]
    fit = _gauss_newton(np.asarray(time * 1e-6, np.float64), speed, motion.at(time, motion.velocity))
    if fit is None:
        return refused(name, f"too short a time in the air; {_WHAT_TO_FLY}")
    figures = {"wind_m_s": float(np.hypot(*fit.constants[1:])), "residual_m_s": float(np.std(fit.residual))}
    factor, half, error = float(fit.constants[0]), fit.half_width(0), float(fit.standard_error[0])
    if error > LARGEST_ERROR * factor or half >= factor:
        return refused(name, f"scale and wind are one where the course hardly changes; {_WHAT_TO_FLY}", **figures)
    told = told_value(observed.logged.parameters.initial, "ASPD_SCALE_1")
    unit = 1.0 if is_raw or told is None else told
    scale = Estimate(
        "ASPD_SCALE_1", "", told, unit / factor, unit / (factor + half), unit / (factor - half),
        unit * error / factor**2, time.size,
    )  # fmt: skip
    return Effect(name, (scale,), "", figures)


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


def _gauss_newton(time_s: Array, speed: Array, velocity: Array) -> WalkingFit | None:
    values, gusts = np.array([1.0, *_first_wind(speed, velocity)]), np.zeros((time_s.size, 2))
    fit: WalkingFit | None = None
    for number in range(_ROUNDS):
        through = velocity.copy()
        through[:, :2] -= values[1:] + gusts
        length = np.maximum(np.linalg.norm(through, axis=1), 0.5)
        by_wind = -values[0] * through[:, :2] / length[:, None]
        design = np.column_stack([length, by_wind])
        target = speed - values[0] * length + design @ values + np.sum(by_wind * gusts, axis=1)
        rows = WalkingRows(time_s, target, design, by_wind, EXPECTED, _KNOTS_S, WIND_MEMORIES_S)
        fit = fit_walking(rows, fit, refined=number == _REFINED)
        if fit is None:
            return None
        values = fit.constants.copy()
        values[0] = np.clip(values[0], 0.3, 3.0)
        gusts = np.column_stack([np.interp(time_s, fit.knot_s, one) for one in fit.course.T])
    return fit


def _first_wind(speed: Array, velocity: Array) -> Array:
    """The wind that fits |v − w|² = s² / k² best, which is linear in it, its square, and 1/k²."""
    design = np.column_stack([-2.0 * velocity[:, :2], np.ones(speed.size), -np.square(speed)])
    found = np.linalg.lstsq(design, -np.sum(np.square(velocity), axis=1), rcond=None)[0]
    return np.asarray(np.clip(found[:2], -20.0, 20.0))
