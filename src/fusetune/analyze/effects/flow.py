"""Optical flow: its scale (`SENS_FLOW_SCALE`) and where it sits (`EKF2_OF_POS_*`).

    flow = s (sight(v + ω × p) + turning) + offset + walk + e        sight = (v_y, −v_x) / distance

The velocity is that of IMU and GNSS, whose own error is the walk; the distance is the range finder's or, without one,
the height above take-off. A distance that is wrong by a share makes the scale wrong by nearly as much.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.range_finder import measured_ranges
from fusetune.analyze.effects.told import NO_MOTION, refused, stands_still, told_value
from fusetune.analyze.effects.walking_regression import WalkingFit, WalkingRows, fit_walking
from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.observed.body_motion import BodyMotion
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.ekf2.feed.message_samples import flow_refusals, flow_samples, taken

Array = npt.NDArray[np.float64]

LARGEST_SCALE_ERROR = 0.03
LARGEST_ARM_ERROR_M = 0.065
"""Standard errors above which they are not told; high above ground an arm moves the flow by next to nothing."""
VELOCITY_MEMORIES_S = (2.0, 10.0)
LEAST_DISTANCE_M = 0.8
LARGEST_DELAY_S = 0.3
"""Further from what it is told no delay is looked for."""
EXPECTED = np.array([np.inf, 1.0, 1.0, 1.0, 0.05, 0.05, 0.1])
"""Standard deviations beforehand: scale; arm m; offsets rad/s; delay s."""
_FEWEST = 200
_LEAST_SCALE = 0.1
_KNOTS_S = 1.0
_ROUNDS = 4
_WHAT_TO_FLY = (
    "fly back and forth and sideways, two to five metres high above textured, even ground, and turn on the spot"
)


class _Flow(NamedTuple):
    """Times (N,), µs, of the motion that is seen; flow (N, 2) and turning as the sensor says (N, 2), rad/s."""

    time: npt.NDArray[np.int64]
    flow: Array
    gyro: Array


def _fitted(
    observed: ObservedFlight,
    motion: BodyMotion,
    ranges: tuple[npt.NDArray[np.int64], Array] | None,
    seen: _Flow,
    like: WalkingFit | None,
) -> WalkingFit | None:
    """Scale, scale times arm, offsets, and by how much the flow is later than the times say."""
    if ranges is not None:
        distance = np.interp(seen.time, *ranges)
    else:
        begin = float(np.interp(observed.airborne[0][0], motion.time, motion.height))
        upright = motion.rotation_at(seen.time)[:, 2, 2]
        distance = (-motion.way_at(seen.time)[:, 2] - begin) / np.maximum(upright, 0.5)
    near = (distance > LEAST_DISTANCE_M) & motion.covers(seen.time)
    if np.count_nonzero(near) < _FEWEST:
        return None
    time, flow, gyro = seen.time[near], seen.flow[near], seen.gyro[near]
    rate, distance = motion.rate_at(time), distance[near]
    gyro = np.where(np.isfinite(gyro), gyro, -rate[:, :2])
    body = np.einsum("nji,nj->ni", motion.rotation_at(time), motion.velocity_at(time))
    sight = np.column_stack([body[:, 1], -body[:, 0]]) / distance[:, None]
    time_s, zero, one = np.asarray(time * 1e-6, np.float64), np.zeros(time.size), np.ones(time.size)
    arms = (
        np.column_stack([rate[:, 2], zero, -rate[:, 0]]),  # (ω × p)_y
        np.column_stack([zero, rate[:, 2], -rate[:, 1]]),  # −(ω × p)_x
    )
    design = []
    for axis, offset in enumerate(([one, zero], [zero, one])):
        # the sensor's own gyro is of the same time as its flow, whatever the delay
        later = -np.gradient(sight[:, axis], time_s)
        columns = [sight[:, axis] + gyro[:, axis], arms[axis] / distance[:, None], *offset, later]
        design.append(np.column_stack(columns))
    # the reference's own error of the velocity, along the body, wanders; far above ground it shows less
    rows = WalkingRows(
        time_s=np.tile(time_s, 2),
        target=flow.ravel(order="F"),
        design=np.vstack(design),
        walking=np.asarray(np.kron(np.eye(2), (1.0 / distance)[:, None]), np.float64),
        expected=EXPECTED,
        knots_s=_KNOTS_S,
        memories_s=VELOCITY_MEMORIES_S,
    )
    return fit_walking(rows, like)


def estimate_flow(observed: ObservedFlight) -> Effect:
    """Scale and lever arm of the optical flow sensor."""
    name, motion = "optical_flow", observed.motion
    table = observed.flight.topic("vehicle_optical_flow")
    if table is None or motion is None:
        return refused(name, NO_MOTION if motion is None else "the log has no optical flow (`vehicle_optical_flow`)")
    samples, _ = flow_samples(table)
    time = samples["time_us"] - round(1e3 * observed.parameters.get("EKF2_OF_DELAY", 0.0))
    usable = taken(table, flow_refusals(table)) & np.isfinite(samples["flow_rate"]).all(axis=1)
    usable &= samples["quality"] > observed.parameters.get("EKF2_OF_QMIN", 0.0)
    usable &= inside(time, observed.airborne) & motion.covers(time)
    if np.count_nonzero(usable) < _FEWEST:
        return refused(name, f"too few measurements of the flow in the air; {_WHAT_TO_FLY}")
    time, flow = time[usable], np.asarray(samples["flow_rate"][usable], np.float64)
    gyro = np.asarray(samples["gyro_rate"][usable], np.float64)[:, :2]
    if stands_still(flow):
        return refused(name, "the optical flow repeats one value")
    ranges = measured_ranges(observed)
    later_s = 0.0
    fit: WalkingFit | None = None
    for _ in range(_ROUNDS):
        fit = _fitted(observed, motion, ranges, _Flow(time - round(later_s * 1e6), flow, gyro), fit)
        if fit is None or fit.constants[0] <= _LEAST_SCALE:
            why = f"the flow does not follow the motion {LEAST_DISTANCE_M} m and more above ground"
            return refused(name, f"{why}; {_WHAT_TO_FLY}")
        later_s = float(np.clip(later_s + fit.constants[-1], -LARGEST_DELAY_S, LARGEST_DELAY_S))
    assert fit is not None
    figures = {
        "residual_rad_s": fit.noise, "by_range": float(ranges is not None), "later_s": later_s,
        "later_error_s": float(fit.standard_error[-1]),
    }  # fmt: skip
    estimates, missing = _told(observed, fit, time.size)
    refusal = f"{', '.join(missing)} not told: {_WHAT_TO_FLY}" if missing else ""
    return Effect(name, tuple(estimates), refusal, figures)


def _told(observed: ObservedFlight, fit: WalkingFit, n: int) -> tuple[list[Estimate], list[str]]:
    """Scale and arms that the fit tells, and the names of those that it does not."""
    estimates, missing = [], []
    scale, half, error = float(fit.constants[0]), fit.half_width(0), float(fit.standard_error[0])
    if error > LARGEST_SCALE_ERROR:
        missing.append("SENS_FLOW_SCALE")
    else:
        told = told_value(observed.logged.parameters.initial, "SENS_FLOW_SCALE")
        unit = 1.0 if told is None else told
        lower, upper = unit / (scale + half), unit / (scale - half)
        estimates.append(Estimate("SENS_FLOW_SCALE", "", told, unit / scale, lower, upper, unit * error / scale**2, n))
    for index, letter in enumerate("XYZ", start=1):
        name = f"EKF2_OF_POS_{letter}"
        spread, width = float(fit.standard_error[index]) / scale, fit.half_width(index) / scale
        if spread > LARGEST_ARM_ERROR_M:
            missing.append(name)
            continue
        value = float(fit.constants[index]) / scale + observed.parameters.get(f"EKF2_IMU_POS_{letter}", 0.0)
        told = observed.parameters.get(name)
        estimates.append(Estimate(name, "m", told, value, value - width, value + width, spread, n))
    return estimates, missing
