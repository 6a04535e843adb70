"""How far the rotors' wash pulls the barometer down near the ground: `EKF2_GND_EFF_DZ` and `EKF2_GND_MAX_HGT`.

    barometer − height = walk − A exp(−h / H)        in the air, h above the ground

The height is that of IMU and GNSS vertical velocity; the ground is where the vehicle took off and where it landed.
Before the motors turn there is no wash, so what the barometer falls by on take-off counts, too. The dead zone is A and
a tenth (PX4's guide); the height is where a tenth of A is left.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.told import NO_MOTION, barometer_rows, estimate_of, is_fixed_wing, refused
from fusetune.analyze.effects.walking_regression import WalkingFit, WalkingRows, fit_walking
from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

MARGIN = 1.1
LEFT_AT_HEIGHT = 0.1
NEAR_M = 1.0
"""So low a vehicle must have been for a second and more."""
LARGEST_ERROR_M = 0.5
LARGEST_SHARE = 0.5
"""Standard error of H over itself."""
ON_GROUND_S = 12.0
"""So much of the time on the ground before and after counts."""
UNSURE_BEFORE_S, UNSURE_AFTER_S = 1.5, 1.5
"""Around a change of the land detector it is not known how much the rotors push."""
_HEIGHTS_M = (0.3, 0.6, 1.0, 1.6, 2.5)
_HEIGHT_LIMITS_M = (0.15, 2.5)
_ROUNDS = 4
_KNOTS_S = 2.0
_FEWEST_NEAR = 8
_WHAT_TO_FLY = "log from boot, take off and climb slowly through the first two metres, and land as slowly"


def estimate_ground_effect(observed: ObservedFlight) -> Effect:
    """Dead zone of the barometer near the ground, and the height below which it acts."""
    motion, name = observed.motion, "ground_effect"
    rows = barometer_rows(observed)
    if motion is None or rows is None:
        return refused(
            name, NO_MOTION if motion is None else "the log has no barometer that measures (`vehicle_air_data`)"
        )
    if is_fixed_wing(observed):
        return refused(name, "EKF2 takes no ground effect of a fixed wing into account")
    if not observed.airborne:
        return refused(name, f"the vehicle did not fly; {_WHAT_TO_FLY}")
    time, altitude = rows
    height = -motion.way_at(time)[:, 2]
    target, flies, used, above = _phases(observed, time, altitude - height, height)
    near = flies & used & (above < NEAR_M)
    figures = {"near_s": float(np.count_nonzero(near)) * _step_s(time), "flights": float(len(observed.airborne))}
    if np.count_nonzero(near) < _FEWEST_NEAR:
        return refused(name, f"the flight has no take-off and no landing with measurements; {_WHAT_TO_FLY}", **figures)
    if not np.any(used & ~flies) and not np.any(used & flies & (above > 4.0 * NEAR_M)):
        return refused(name, f"the vehicle stayed near the ground all the time; {_WHAT_TO_FLY}", **figures)
    found = _fit(np.asarray(time[used] * 1e-6, np.float64), target[used], flies[used], above[used])
    if found is None:
        return refused(name, f"too short a log; {_WHAT_TO_FLY}", **figures)
    fit, scale_m = found
    figures |= {
        "dip_m": float(fit.constants[0]),
        "falls_over_m": scale_m,
        "noise_m": fit.noise,
        "walk_m_sqrt_s": fit.walk,
    }
    if fit.standard_error[0] > LARGEST_ERROR_M:
        why = f"the dip is not told from the wander of barometer and GNSS (± {fit.half_width(0):.1f} m)"
        return refused(name, f"{why}; {_WHAT_TO_FLY}", **figures)
    told, dip = observed.parameters, estimate_of(fit, 0, "EKF2_GND_EFF_DZ", "m", None, MARGIN)
    if dip.upper < 0.0:
        return refused(name, "the barometer rises near the ground, which no dead zone of EKF2 is for", **figures)
    zone = replace(dip, value=max(dip.value, 0.0), lower=max(dip.lower, 0.0), told=told.get("EKF2_GND_EFF_DZ"))
    estimates = [zone]
    # of a dip that may be none, or whose height is not told, nothing is said of where it ends
    if fit.constants[0] > fit.half_width(0) and fit.standard_error[1] < LARGEST_SHARE * scale_m:
        estimates.append(_height(fit, scale_m, told.get("EKF2_GND_MAX_HGT")))
    return Effect(name, tuple(estimates), "", figures)


def _height(fit: WalkingFit, scale_m: float, told: float | None) -> Estimate:
    factor, highest = -math.log(LEFT_AT_HEIGHT), PARAMETERS["EKF2_GND_MAX_HGT"].maximum or math.inf
    half, error = fit.half_width(1), factor * float(fit.standard_error[1])
    value, low, high = (min(factor * max(one, 0.0), highest) for one in (scale_m, scale_m - half, scale_m + half))
    return Estimate("EKF2_GND_MAX_HGT", "m", told, value, low, high, error, fit.residual.size)


def _step_s(time: Times) -> float:
    return float(np.median(np.diff(time))) * 1e-6 if time.size > 1 else 0.0


def _phases(
    observed: ObservedFlight, time: Times, target: Array, height: Array
) -> tuple[Array, npt.NDArray[np.bool_], npt.NDArray[np.bool_], Array]:
    """Target, whether the vehicle flies, whether a row counts, and its height above the nearest ground."""
    flies = inside(time, observed.airborne)
    edges = [edge for one in observed.airborne for edge in one]
    before, after = round(UNSURE_BEFORE_S * 1e6), round(UNSURE_AFTER_S * 1e6)
    unsure = inside(time, [(start - before, start) for start, _ in observed.airborne])
    unsure |= inside(time, [(stop - before, stop + after) for _, stop in observed.airborne])
    distance = np.min(np.abs(time[:, None] - np.array(edges)[None]), axis=1)
    used = ~unsure & (flies | (distance < ON_GROUND_S * 1e6)) & np.isfinite(target)
    above = np.full(time.size, np.inf)
    for start, stop in observed.airborne:
        own = (time >= start) & (time < stop)
        took_off, landed = (float(np.interp(edge, time, height)) for edge in (start, stop))
        first = time < (start + stop) // 2
        above = np.where(own, height - np.where(first, took_off, landed), above)
    return target, flies, used, np.maximum(above, 0.0)


def _fit(time_s: Array, target: Array, flies: npt.NDArray[np.bool_], above: Array) -> tuple[WalkingFit, float] | None:
    """The fit, whose first constant is A and whose second is a change of H, and H."""
    walking = np.ones((time_s.size, 1))

    def rows(columns: list[Array], expected: list[float]) -> WalkingRows:
        return WalkingRows(time_s, target, np.column_stack(columns), walking, np.array(expected), _KNOTS_S)

    def wash(scale: float) -> Array:
        return np.where(flies, -np.exp(-above / scale), 0.0)

    first = fit_walking(rows([wash(1.0)], [np.inf]))
    if first is None:
        return None
    tried = [(fit_walking(rows([wash(one)], [np.inf]), first), one) for one in _HEIGHTS_M]
    fit, scale = min(((one, height) for one, height in tried if one is not None), key=lambda pair: pair[0].noise)
    for number in range(_ROUNDS):
        shape = wash(scale)
        slope = fit.constants[0] * shape * np.where(flies, above, 0.0) / scale**2
        again = fit_walking(rows([shape, slope], [np.inf, 1.0]), fit, refined=number == 1)
        if again is None:
            return None
        change = float(np.clip(again.constants[1], -0.5 * scale, 0.5 * scale))
        scale, fit = float(np.clip(scale + change, *_HEIGHT_LIMITS_M)), again
    return fit, scale
