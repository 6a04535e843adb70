"""Where the camera of a vision system sits: `EKF2_EV_POS_*`.

    z = F (x(t) + R p) + walk + e

x is the replay's way, F turns into the frame of the vision system, whose heading is its own; its scale may be wrong by
some percent. Positions are taken; of a system that tells velocities alone the arm shows in fast turns only.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.range_finder import lever_arm
from fusetune.analyze.effects.told import NO_MOTION, refused, stands_still
from fusetune.analyze.effects.walking_regression import WalkingFit, WalkingRows, fit_walking
from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.observed.body_motion import BodyMotion
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.ekf2.feed.message_samples import vision_samples
from fusetune.ekf2.feed.sensor_samples import EV_FRAME_FRD, EV_FRAME_NED

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

FASTEST_HZ = 15.0
HEADING, SCALE, DELAY = 3, 4, 5
"""Of the constants; the first three are the arm."""
EXPECTED = np.array([1.0, 1.0, 1.0, np.inf, 0.3, 0.1])
"""Standard deviations beforehand: arm m, heading rad, scale, delay s."""
POSITION_UNCERTAINTY, WAY_ERROR_M = 1.3, 0.015
"""Factor on the standard errors, and what is added to those of the arm: the way drifts with GNSS and in turns is off by
some centimetres, of which no walk is the whole (docs/effects.md)."""
LARGEST_SCALE_ERROR = 0.05
LARGEST_DELAY_S = 0.3
"""Further from what it is told no delay is looked for."""
_FEWEST = 200
_KNOTS_S = 1.0
_ROUNDS = 3
_WHAT_TO_FLY = (
    "fly with hard starts and stops in all directions, and turn on the spot, where the vision system sees well"
)


def estimate_vision_arm(observed: ObservedFlight) -> Effect:
    """Lever arm of the camera."""
    name, motion = "vision_lever_arm", observed.motion
    table = observed.flight.topic("vehicle_visual_odometry")
    if table is None or motion is None:
        return refused(name, NO_MOTION if motion is None else "the log has no vision (`vehicle_visual_odometry`)")
    samples, _ = vision_samples(table, observed.flight.release)
    time = samples["time_us"] - round(1e3 * observed.parameters.get("EKF2_EV_DELAY", 0.0))
    known = np.isin(samples["pos_frame"], (EV_FRAME_NED, EV_FRAME_FRD)) & np.isfinite(samples["pos"]).all(axis=1)
    known &= inside(time, observed.airborne) & motion.covers(time)
    if np.count_nonzero(known) < _FEWEST:
        return refused(name, f"too few positions of the vision system in the air; {_WHAT_TO_FLY}")
    time, measured = time[known], np.asarray(samples["pos"][known], np.float64)
    if stands_still(measured):
        return refused(name, "the vision system repeats one position")
    every = max(1, round(1.0 / (FASTEST_HZ * max(float(np.median(np.diff(time))) * 1e-6, 1e-3))))
    found = _fit(motion, time[::every], measured[::every])
    if found is None:
        return refused(name, f"too short a time in the air; {_WHAT_TO_FLY}")
    fit, heading, later_s = found
    errors = POSITION_UNCERTAINTY * fit.standard_error
    errors[:HEADING] = np.hypot(errors[:HEADING], WAY_ERROR_M)
    fit = replace(fit, standard_error=errors)
    scale = 1.0 + float(fit.constants[SCALE])
    figures = {
        "residual_m": float(np.std(fit.residual)), "walk_m_sqrt_s": fit.walk, "heading_deg": math.degrees(heading),
        "heading_error_deg": math.degrees(float(fit.standard_error[HEADING])), "later_s": later_s,
    }  # fmt: skip
    arm = lever_arm(observed, name, "EKF2_EV_POS", fit, figures, _WHAT_TO_FLY)
    half, error = fit.half_width(SCALE), float(fit.standard_error[SCALE])
    told = Estimate("vision_scale", "", None, scale, scale - half, scale + half, error, fit.residual.size)
    return replace(arm, estimates=(*arm.estimates, told)) if error <= LARGEST_SCALE_ERROR else arm


def _fit(motion: BodyMotion, time: Times, measured: Array) -> tuple[WalkingFit, float, float] | None:
    """The fit, the heading of the vision system's frame, rad, and by how much it is later than told, s."""
    heading, time_s = _first_heading(motion.way_at(time), measured), np.asarray(time * 1e-6, np.float64)
    later_s, scale = 0.0, 1.0
    fit: WalkingFit | None = None
    walking: Array = np.asarray(np.kron(np.eye(3), np.ones((time.size, 1))), np.float64)
    for _ in range(_ROUNDS):
        then = time - round(later_s * 1e6)
        rotation, velocity, way = motion.rotation_at(then), motion.velocity_at(then), motion.way_at(then)
        way = way - way.mean(axis=0)
        cosine, sine = np.cos(heading), np.sin(heading)
        back = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        seen = measured @ back.T
        design = []
        for axis in range(3):
            across = -way[:, 1] if axis == 0 else way[:, 0] if axis == 1 else np.zeros(time.size)
            design.append(np.column_stack([scale * rotation[:, axis], across, way[:, axis], -velocity[:, axis]]))
        target = (seen - seen.mean(axis=0) - way).ravel(order="F")
        rows = WalkingRows(np.tile(time_s, 3), target, np.vstack(design), walking, EXPECTED, _KNOTS_S)
        fit = fit_walking(rows, fit)
        if fit is None:
            return None
        heading += float(fit.constants[HEADING])
        scale = float(np.clip(1.0 + fit.constants[SCALE], 0.3, 3.0))
        later_s = float(np.clip(later_s + fit.constants[DELAY], -LARGEST_DELAY_S, LARGEST_DELAY_S))
    assert fit is not None
    return fit, heading, later_s


def _first_heading(way: Array, measured: Array) -> float:
    """Turn from the way into the frame of the measurement that fits their changes over about a second best."""
    step = max(1, round(FASTEST_HZ))
    one, other = way[step:, :2] - way[:-step, :2], measured[step:, :2] - measured[:-step, :2]
    return float(np.arctan2(np.sum(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]), np.sum(one * other)))
