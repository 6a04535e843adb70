"""Range finder: where it sits (`EKF2_RNG_POS_*`), its noise (`EKF2_RNG_NOISE`, `_SFE`), its gate (`EKF2_RNG_K_GATE`).

    d cos(tilt) = h(t) − (R p)_down + walk + e        var e = RNG_NOISE² + (RNG_SFE d)²

h is the height that IMU and GNSS vertical velocity tell, the walk is their drift and the ground. Height and time of the
sensor may be wrong by a share and by some milliseconds, too.

The gate is that of the filter's own check (`ekf2/filter/aid_sources/range_finder`): change of the distance against
vertical velocity, over 2 s. It is set where the check of this flight stays below it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import stdtrit

from fusetune.analyze.delays.delayed_series import measured_distances
from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.told import NO_MOTION, refused, stands_still
from fusetune.analyze.effects.walking_regression import BLOCK_S, WalkingFit, WalkingRows, fit_walking
from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.ekf2.filter.aid_sources.range_finder.range_finder_consistency_check import (
    DT_MAX_S,
    DT_MIN_S,
    SIGNED_TEST_RATIO_TAU,
)

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

LARGEST_ARM_ERROR_M = 0.1
LARGEST_WALK_M_SQRT_S = 0.25
"""Of ground and height reference; on rougher ground the noise of the sensor cannot be told from it."""
LEAST_DISTANCE_RATIO = 2.0
"""From the smallest to the largest distance, for the share that grows with it."""
NOISE_UNCERTAINTY = 1.6
"""Factor on the standard errors of the noises, by which errors were larger on made flights (docs/effects.md): what of
the noise the walk takes along is known on the average alone."""
GATE_SIGMAS = 3.0
DELAY_S, SCALE, TILT_RAD = 0.02, 0.02, 0.005
"""Standard deviations beforehand of errors of delay, scale and mounting; a sensor that looks aslant, or an attitude
that is off, is an arm that grows with the distance."""
_FEWEST = 100
_KNOTS_S = 1.0
_STEEPEST = 0.7
"""cos of the tilt beyond which EKF2 takes no range."""
_ARM_WORDS = "fly low, at two to four metres, with hard starts and stops in all directions above even ground"
_NOISE_WORDS = "fly above even ground, slowly up and down through the sensor's range"


@dataclass(frozen=True)
class RangeFit:
    """Distances (N,) at times (N,), µs, m; what of them is noise; the fit, whose first three constants are the arm."""

    time: Times
    distance: Array
    noise: Array
    fit: WalkingFit


def measured_ranges(observed: ObservedFlight) -> tuple[Times, Array] | None:
    """Times of measurement, µs, and distances, m, of the range finder that looks down; None without one."""
    found = measured_distances(observed.flight)
    if found is None:
        return None
    time, distance = found
    return time - round(1e3 * observed.parameters.get("EKF2_RNG_DELAY", 0.0)), np.asarray(distance, np.float64)


def fit_range(observed: ObservedFlight) -> RangeFit | str:
    """Fit the distances to the motion; a refusal in words where that cannot be done."""
    motion, found = observed.motion, measured_ranges(observed)
    if motion is None:
        return NO_MOTION
    if found is None:
        return "the log has no range finder that looks down (`distance_sensor`)"
    time, distance = found
    used = inside(time, observed.airborne) & motion.covers(time)
    time, distance = time[used], distance[used]
    if time.size < _FEWEST:
        return "too few distances in the air"
    if stands_still(distance):
        return "the range finder repeats one value"
    down = motion.rotation_at(time)[:, 2]
    upright = down[:, 2] > _STEEPEST
    time, distance, down = time[upright], distance[upright], down[upright]
    if time.size < _FEWEST:
        return "too few distances in the air"
    height = -motion.way_at(time)[:, 2]
    measured = distance * down[:, 2]
    vertical = motion.velocity_at(time)[:, 2]
    # a sensor that is later than told shows where the vehicle was
    far = height - height[0] + measured[0]
    design = np.column_stack([-down, vertical, far, far[:, None] * down[:, :2]])
    expected = np.array([1.0, 1.0, 1.0, DELAY_S, SCALE, TILT_RAD, TILT_RAD])
    time_s = np.asarray(time * 1e-6, np.float64)
    weight: Array = np.ones(time.size)
    noise: Array = np.zeros(time.size)
    fit: WalkingFit | None = None
    for _ in range(2):
        columns = (measured - height) * weight, design * weight[:, None], weight[:, None]
        fit = fit_walking(WalkingRows(time_s, *columns, expected, _KNOTS_S))
        if fit is None:
            return "too short a time in the air"
        noise = fit.residual / weight
        # farther means noisier: the likeliest noises of the first look weigh the second
        white, share = _variances(np.square(noise), distance, grows=True)
        deviation = np.sqrt(white + share * np.square(distance))
        weight = float(np.median(deviation)) / np.maximum(deviation, 1e-4)
    assert fit is not None
    return RangeFit(time, distance, noise, fit)


def estimate_range_arm(observed: ObservedFlight, fitted: RangeFit | str | None = None) -> Effect:
    """Where the range finder sits in the body.

    Parameters
    ----------
    fitted : by `fit_range`, where it is at hand
    """
    fitted, name = fit_range(observed) if fitted is None else fitted, "range_lever_arm"
    if isinstance(fitted, str):
        return refused(name, fitted)
    figures = {"residual_m": float(np.std(fitted.noise)), "walk_m_sqrt_s": fitted.fit.walk}
    return lever_arm(observed, name, "EKF2_RNG_POS", fitted.fit, figures, _ARM_WORDS)


def lever_arm(
    observed: ObservedFlight, name: str, parameter: str, fit: WalkingFit, figures: dict[str, float], words: str
) -> Effect:
    """The first three constants of a fit as a lever arm from the IMU, told from the origin of the body."""
    estimates, missing = [], []
    for index, axis in enumerate("XYZ"):
        if fit.standard_error[index] > LARGEST_ARM_ERROR_M:
            missing.append(f"{parameter}_{axis}")
            continue
        origin = observed.parameters.get(f"EKF2_IMU_POS_{axis}", 0.0)
        value, half = float(fit.constants[index]) + origin, fit.half_width(index)
        told = observed.parameters.get(f"{parameter}_{axis}")
        estimates.append(
            Estimate(
                f"{parameter}_{axis}", "m", told, value, value - half, value + half, float(fit.standard_error[index]),
                fit.residual.size,
            )
        )  # fmt: skip
    refusal = f"{', '.join(missing)} not told: {words}" if missing else ""
    return Effect(name, tuple(estimates), refusal, figures)


def estimate_range_noise(observed: ObservedFlight, fitted: RangeFit | str | None = None) -> Effect:
    """Noise of the distance, the share of it that grows with the distance, and the gate of the consistency check.

    Parameters
    ----------
    fitted : by `fit_range`, where it is at hand
    """
    fitted, name = fit_range(observed) if fitted is None else fitted, "range_noise"
    if isinstance(fitted, str):
        return refused(name, fitted)
    fit, distance = fitted.fit, fitted.distance
    figures = {
        "walk_m_sqrt_s": fit.walk, "noise_m": fit.noise, "nearest_m": float(np.percentile(distance, 5)),
        "farthest_m": float(np.percentile(distance, 95)),
    }  # fmt: skip
    if fit.walk > LARGEST_WALK_M_SQRT_S:
        return refused(name, f"the ground changes by {fit.walk:.2f} m in a second; {_NOISE_WORDS}", **figures)
    # the walk takes a part of the noise with it; `noise` has it back
    squares = np.square(fitted.noise) * (fit.noise**2 / max(float(np.mean(np.square(fit.residual))), 1e-12))
    block = np.floor((fitted.time - fitted.time[0]) * 1e-6 / BLOCK_S).astype(np.int64)
    grows = figures["farthest_m"] > LEAST_DISTANCE_RATIO * figures["nearest_m"]
    white, share, errors = _noises(squares, distance, block, grows=grows)
    estimates = [_root(observed, "EKF2_RNG_NOISE", "m", white, errors[0], int(errors[2]), squares.size, 0.01)]
    if grows:
        estimates.append(_root(observed, "EKF2_RNG_SFE", "m/m", share, errors[1], int(errors[2]), squares.size, 0.0))
    gate = _gate(observed, fitted, white, share if grows else 0.0)
    if gate is not None:
        estimates.append(gate)
    refusal = "" if grows else f"EKF2_RNG_SFE not told: the distance hardly changes; {_NOISE_WORDS}"
    return Effect(name, tuple(estimates), refusal, figures)


def _noises(
    squares: Array, distance: Array, block: npt.NDArray[np.int64], *, grows: bool
) -> tuple[float, float, tuple[float, float, float]]:
    """Variance at no distance and its growth with the distance squared; their standard errors and the freedom."""
    parts = [block == one for one in np.unique(block)]
    whole = _variances(squares, distance, grows=grows)
    left_out = np.array([_variances(squares[~own], distance[~own], grows=grows) for own in parts])
    spread = NOISE_UNCERTAINTY * np.sqrt((len(parts) - 1) * np.var(left_out, axis=0))
    return float(whole[0]), float(whole[1]), (float(spread[0]), float(spread[1]), float(len(parts) - 1))


def _variances(squares: Array, distance: Array, *, grows: bool) -> Array:
    """Likeliest (a, b) of var = a + b d² of normal errors, by scoring from their mean; neither below 0."""
    found = np.array([float(np.mean(squares)), 0.0])
    if not grows:
        return found
    design = np.column_stack([np.ones(distance.size), np.square(distance)])
    for _ in range(8):
        weight = 1.0 / np.square(np.maximum(design @ found, 1e-8))
        normal = (design * weight[:, None]).T @ design
        found = np.asarray(np.linalg.lstsq(normal, (design * weight[:, None]).T @ squares, rcond=None)[0])
        if found[1] < 0.0:
            return np.array([float(np.mean(squares)), 0.0])
        if found[0] < 0.0:
            return np.array([0.0, float(np.mean(squares / np.square(distance)))])
    return found


def _root(
    observed: ObservedFlight, name: str, unit: str, variance: float, error: float, freedom: int, n: int, least: float
) -> Estimate:
    """A standard deviation by its variance."""
    half = float(stdtrit(max(freedom, 1), 0.975)) * error
    value, lower = math.sqrt(max(variance, 0.0)), math.sqrt(max(variance - half, 0.0))
    upper = math.sqrt(max(variance + half, 0.0))
    spread = error / (2.0 * value) if value > 0.0 else upper / 2.0
    told = observed.parameters.get(name)
    return Estimate(name, unit, told, max(value, least), min(max(lower, 0.0), max(value, least)), upper, spread, n)


def _gate(observed: ObservedFlight, fitted: RangeFit, white: float, share: float) -> Estimate | None:
    """The gate that the check's own figure, over this flight, stays below by three of its standard deviations."""
    motion = observed.motion
    assert motion is not None
    states = observed.replayed.states()
    time, distance = fitted.time, fitted.distance
    cosine = motion.rotation_at(time)[:, 2, 2]
    height = distance * cosine
    step_s = np.diff(time) * 1e-6
    kept = (step_s >= DT_MIN_S) & (step_s <= DT_MAX_S)
    if np.count_nonzero(kept) < _FEWEST:
        return None
    rate = -np.diff(height)[kept] / step_s[kept] - motion.velocity_at(time)[1:][kept, 2]
    vertical = np.interp(time[1:][kept], states.time, states.velocity_variance[:, 2])
    variance = 2.0 * (white + share * np.square(distance[1:][kept])) / np.square(step_s[kept]) + vertical
    ratio = np.sign(rate) * np.square(rate) / np.maximum(variance, 1e-9)
    filtered, blocks = 0.0, dict[int, float]()
    place = np.floor((time[1:][kept] - time[0]) * 1e-6 / (2.0 * BLOCK_S)).astype(np.int64)
    for value, dt, block in zip(ratio.tolist(), step_s[kept].tolist(), place.tolist(), strict=True):
        filtered += dt / (dt + SIGNED_TEST_RATIO_TAU) * (value - filtered)
        blocks[block] = max(blocks.get(block, 0.0), abs(filtered))
    highest = np.sqrt(np.array(list(blocks.values())))
    if highest.size < 3:
        return None
    spread = float(np.std(highest, ddof=1))
    value = float(np.mean(highest)) + GATE_SIGMAS * spread
    error = spread * math.sqrt((1.0 + 0.5 * GATE_SIGMAS**2) / highest.size)
    half = float(stdtrit(highest.size - 1, 0.975)) * error
    told = observed.parameters.get("EKF2_RNG_K_GATE")
    low, high = max(value - half, 0.1), value + half
    return Estimate("EKF2_RNG_K_GATE", "SD", told, max(value, 0.1), low, high, error, int(ratio.size))
