"""Drag of a multicopter: `EKF2_BCOEF_X`, `_Y`, `EKF2_MCOEF` and `EKF2_DRAG_NOISE`.

The model is the filter's own (`ekf2/filter/aid_sources/drag/drag_fusion.py`): with the air velocity b in the body,

    f_i = −(m + κ(b) |b|) b_i + a_i        κ(b) = √((κ_x b_x)² + (κ_y b_y)²) / √(b_x² + b_y²)

κ = ρ / (2 BCOEF), m = MCOEF √(ρ/ρ₀). Beside it are estimated, for each flight: the wind and how it wanders, the offsets
a_i of the accelerometer (with which gravity leaks in: left out, they end up in the coefficients), and an error of the
heading, which turns forward velocity into sideward.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import stdtrit

from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.told import NO_MOTION, is_fixed_wing, refused
from fusetune.analyze.effects.walking_regression import WalkingFit, WalkingRows, fit_walking, log_information
from fusetune.analyze.observed.body_motion import BodyMotion
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.ekf2.filter.aid_sources.drag.drag_fusion import MIN_OBSERVATION_VARIANCE
from fusetune.ekf2.numerics.constants import AIR_DENSITY_SEA_LEVEL

Array = npt.NDArray[np.float64]

M, KAPPA_X, KAPPA_Y, HEADING, OFFSET_X, OFFSET_Y, WIND_N, WIND_E = range(8)
_FIRST = np.array([0.2, 0.01, 0.01, 0.0, 0.0, 0.0, 0.0, 0.0])
EXPECTED = np.array([1.0, 0.1, 0.1, 0.05, 0.15, 0.15, 15.0, 15.0])
"""Standard deviations beforehand: 1/s, 1/m, rad, m/s² and m/s."""
LEAST_SPEED_M_S = 2.0
"""Standard deviation of the horizontal velocity; below, wind and drag are one."""
LARGEST_RELATIVE_ERROR = 0.25
"""A coefficient whose standard error is a larger share of it is not told."""
WIND_MEMORIES_S = (2.0, 5.0, 15.0, 60.0)
_ROUNDS = 6
_SEARCHED_FROM_NEW, _REFINED = 1, 3
"""The first rounds are too far from the truth for the gusts' memory to be kept."""
_STANDS = 1e-4
_KNOTS_S = 1.0
_FEWEST_ROWS = 200
_WHAT_TO_FLY = (
    "fly forward, backward, left and right between rest and full speed, several times each, on two headings a quarter"
    " turn apart, in still air, for two minutes"
)


@dataclass(frozen=True)
class DragFit:
    """Drag and wind of a flight.

    Attributes
    ----------
    fit : of the last round; constants in the order M … WIND_E
    parameters : (8,)
    likeliest : with the constants that are the likeliest whatever the gusts were; `fit` has the likeliest with them
    rho : air density, kg/m³
    rows : of the motion that were used
    """

    fit: WalkingFit
    parameters: Array
    likeliest: WalkingFit
    rho: float
    rows: npt.NDArray[np.bool_]

    def wind(self, time_s: Array) -> Array:
        """Wind at times (N,), s, north and east → (N, 2) m/s; the ends hold outside."""
        course = self.fit.course + self.parameters[[WIND_N, WIND_E]]
        return np.column_stack([np.interp(time_s, self.fit.knot_s, one) for one in course.T])

    def wind_errors(self, time_s: Array) -> Array:
        """How the wind may be off, (N, 2, 8) m/s at times (N,), s: courses, each times a standard normal number.

        What drag and offsets are off by, the wind that is left over follows: drag that is too large by a share makes
        the wind too large by that share of the speed.
        """
        moved = self.fit.follows.copy()
        moved[:, 0, WIND_N] += 1.0
        moved[:, 1, WIND_E] += 1.0
        size, turn = np.linalg.eigh(self.fit.covariance)
        courses = (moved @ (turn * np.sqrt(np.maximum(size, 0.0)))).reshape(self.fit.knot_s.size, -1)
        between = np.column_stack([np.interp(time_s, self.fit.knot_s, one) for one in courses.T])
        return between.reshape(time_s.size, 2, size.size)


def fit_drag(observed: ObservedFlight) -> DragFit | str:
    """Fit drag and wind together; a refusal in words where the flight does not tell them."""
    motion = observed.motion
    if motion is None:
        return NO_MOTION
    if is_fixed_wing(observed):
        return "not a multicopter"
    used = motion.within(observed.clear_of_ground)
    if np.count_nonzero(used) < _FEWEST_ROWS:
        return f"too short a time in the air away from the ground; {_WHAT_TO_FLY}"
    excited = float(np.linalg.norm(np.std(motion.velocity[used, :2], axis=0)))
    if excited < LEAST_SPEED_M_S:
        why = f"horizontal velocity changes by {excited:.1f} m/s only, so wind and drag cannot be told apart"
        return f"{why}; {_WHAT_TO_FLY}"
    fitted = _gauss_newton(motion, used)
    return fitted if isinstance(fitted, str) else DragFit(*fitted, air_density(observed), used)


def air_density(observed: ObservedFlight) -> float:
    """Mean over the flight, kg/m³; that at sea level where the log does not tell it."""
    table = observed.flight.topic("vehicle_air_data")
    if table is None or "rho" not in table or not table["rho"].size:
        return AIR_DENSITY_SEA_LEVEL
    rho = float(np.median(table["rho"]))
    return rho if math.isfinite(rho) and rho > 0.1 else AIR_DENSITY_SEA_LEVEL


def _gauss_newton(motion: BodyMotion, used: npt.NDArray[np.bool_]) -> tuple[WalkingFit, Array, WalkingFit] | str:
    rotation, velocity = motion.rotation[used], motion.velocity[used]
    time_s, force = motion.time_s[used], motion.specific_force[used][:, :2].ravel(order="F")
    both = np.concatenate([time_s, time_s])
    gusts: Array = np.zeros((time_s.size, 2))
    values: Array = _FIRST.copy()
    fit: WalkingFit | None = None
    for number in range(_ROUNDS):
        predicted = predicted_force(values, rotation, velocity, gusts)
        design = np.column_stack([_slope(values, one, rotation, velocity, gusts, predicted) for one in range(8)])
        walking = design[:, [WIND_N, WIND_E]]
        target = force - predicted + design @ values + walking[:, 0] * np.tile(gusts[:, 0], 2)
        target += walking[:, 1] * np.tile(gusts[:, 1], 2)
        rows = WalkingRows(both, target, design, walking, EXPECTED, _KNOTS_S, WIND_MEMORIES_S)
        fit = fit_walking(rows, fit if number > _SEARCHED_FROM_NEW else None, refined=number == _REFINED)
        if fit is None:
            return f"too short a time in the air; {_WHAT_TO_FLY}"
        change = fit.constants - values
        values = fit.constants.copy()
        # a negative drag has no place in the model: it is where the ellipse has its edge
        values[[KAPPA_X, KAPPA_Y]] = np.clip(values[[KAPPA_X, KAPPA_Y]], 1e-4, 0.5)
        gusts = np.column_stack([np.interp(time_s, fit.knot_s, one) for one in fit.course.T])
        if number > _REFINED and np.all(np.abs(change) < _STANDS + 0.02 * fit.standard_error):
            break
    assert fit is not None
    return fit, values, _without_favour(fit, rows, values, rotation, velocity, gusts)


def _without_favour(
    fit: WalkingFit, rows: WalkingRows, values: Array, rotation: Array, velocity: Array, gusts: Array
) -> WalkingFit:
    """Moved to the likeliest drag whatever the gusts were; together with them it is too large, as smaller gusts do."""
    slope, now = np.zeros(values.size), log_information(rows, fit)
    for index, least in ((M, 0.05), (KAPPA_X, 0.002), (KAPPA_Y, 0.002)):
        moved = values.copy()
        step = 0.02 * max(float(values[index]), least)
        moved[index] += step
        predicted = predicted_force(moved, rotation, velocity, gusts)
        walking = [_slope(moved, one, rotation, velocity, gusts, predicted) for one in (WIND_N, WIND_E)]
        slope[index] = (log_information(replace(rows, walking=np.column_stack(walking)), fit) - now) / step
    shift = -0.5 * fit.promised @ slope
    # one step of a likelihood that is far from a parabola where it is large
    within = fit.standard_error / np.maximum(np.abs(shift), 1e-12)
    return replace(fit, constants=fit.constants + min(1.0, float(np.min(within))) * shift)


def predicted_force(values: Array, rotation: Array, velocity: Array, gusts: Array) -> Array:
    """Specific force along body x, then y, (2 N,) m/s², for parameters (8,) and gusts (N, 2) beside the mean wind."""
    through = velocity.copy()
    through[:, :2] -= values[[WIND_N, WIND_E]] + gusts
    x, y, z = np.einsum("nji,nj->in", rotation, through)
    x, y = x + values[HEADING] * y, y - values[HEADING] * x
    across = np.maximum(np.hypot(x, y), 1e-6)
    kappa = np.hypot(values[KAPPA_X] * x, values[KAPPA_Y] * y) / across
    own = values[M] + kappa * np.sqrt(x * x + y * y + z * z)
    return np.concatenate([values[OFFSET_X] - own * x, values[OFFSET_Y] - own * y])


def _slope(values: Array, index: int, rotation: Array, velocity: Array, gusts: Array, predicted: Array) -> Array:
    step = 1e-5 if index in (KAPPA_X, KAPPA_Y) else 1e-4
    moved = values.copy()
    moved[index] += step
    return np.asarray((predicted_force(moved, rotation, velocity, gusts) - predicted) / step)


def estimate_drag(observed: ObservedFlight, fitted: DragFit | str | None = None) -> Effect:
    """Ballistic and momentum drag coefficients, and the noise of the drag measurement.

    Parameters
    ----------
    fitted : by `fit_drag`, where it is at hand
    """
    fitted = fit_drag(observed) if fitted is None else fitted
    if isinstance(fitted, str):
        return refused("drag", fitted)
    motion, told = observed.motion, observed.parameters
    assert motion is not None
    momentum = math.sqrt(fitted.rho / AIR_DENSITY_SEA_LEVEL)
    figures = {
        "wind_m_s": float(np.hypot(*fitted.parameters[[WIND_N, WIND_E]])),
        "gust_m_s": float(np.linalg.norm(np.std(fitted.fit.course, axis=0))),
        "offset_x_m_s2": float(fitted.parameters[OFFSET_X]),
        "offset_y_m_s2": float(fitted.parameters[OFFSET_Y]),
        "residual_m_s2": float(np.std(fitted.fit.residual)),
        "velocity_m_s": float(np.linalg.norm(np.std(motion.velocity[fitted.rows, :2], axis=0))),
    }
    found: list[Estimate] = []
    missing: list[str] = []
    for index, axis in ((KAPPA_X, "X"), (KAPPA_Y, "Y")):
        name = f"EKF2_BCOEF_{axis}"
        one = _reciprocal(fitted.likeliest, index, name, 0.5 * fitted.rho, told.get(name))
        if one is None:
            missing.append(name)
        else:
            found.append(one)
    m = _share(fitted.likeliest, M, "EKF2_MCOEF", "1/s", 1.0 / momentum, told.get("EKF2_MCOEF"))
    if m is None:
        missing.append("EKF2_MCOEF")
    else:
        found.append(m)
    if found:
        found.append(_noise(observed, fitted))
    names = ", ".join(missing)
    refusal = f"{names} not told: too little change of speed along that axis; {_WHAT_TO_FLY}" if missing else ""
    return Effect("drag", tuple(found), refusal, figures)


def _share(fit: WalkingFit, index: int, name: str, unit: str, factor: float, told: float | None) -> Estimate | None:
    value, error = float(fit.constants[index]), float(fit.standard_error[index])
    if value <= 0.0 or error > LARGEST_RELATIVE_ERROR * value:
        return None
    half = fit.half_width(index)
    lower, upper = max(value - half, 0.0) * factor, (value + half) * factor
    return Estimate(name, unit, told, value * factor, lower, upper, error * factor, int(fit.residual.size))


def _reciprocal(fit: WalkingFit, index: int, name: str, factor: float, told: float | None) -> Estimate | None:
    """`factor` over a constant; the interval is that of the constant, turned over."""
    value, error, half = float(fit.constants[index]), float(fit.standard_error[index]), fit.half_width(index)
    if value <= 0.0 or error > LARGEST_RELATIVE_ERROR * value or half >= value:
        return None
    count = int(fit.residual.size)
    found, spread = factor / value, factor * error / value**2
    return Estimate(name, "kg/m^2", told, found, factor / (value + half), factor / (value - half), spread, count)


def _noise(observed: ObservedFlight, fitted: DragFit) -> Estimate:
    """Variance of what PX4 takes as a drag measurement, the mean of five IMU samples, about the drag that was found."""
    motion, record = observed.motion, observed.replayed
    assert motion is not None
    assert record.steps is not None
    steps = record.steps()
    inside = (steps.time >= motion.time[fitted.rows][0]) & (steps.time <= motion.time[fitted.rows][-1])
    time = steps.time[inside]
    felt = (steps.delta_velocity / steps.delta_velocity_dt[:, None])[inside, :2]
    mean = np.column_stack([np.interp(time, motion.time, one) for one in motion.specific_force[:, :2].T])
    fast = felt - steps.accel_bias.mean(axis=0)[:2] - mean
    slow = fitted.fit.residual
    variance = float(np.var(fast) + np.var(slow))
    # neighbours are alike: so many of them are worth one
    blocks = np.array([float(np.mean(part**2)) for part in np.array_split(slow, max(fitted.fit.blocks, 4))])
    error = float(np.std(blocks) / math.sqrt(blocks.size))
    half = float(stdtrit(blocks.size - 1, 0.975)) * error
    value = max(variance, MIN_OBSERVATION_VARIANCE)
    return Estimate(
        "EKF2_DRAG_NOISE", "(m/s^2)^2", observed.parameters.get("EKF2_DRAG_NOISE"), value,
        max(variance - half, MIN_OBSERVATION_VARIANCE), max(variance + half, MIN_OBSERVATION_VARIANCE), error,
        slow.size,
    )  # fmt: skip
