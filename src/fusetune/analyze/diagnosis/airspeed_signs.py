"""Airspeed against the velocity over the ground less a constant wind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.delays.delayed_series import measured_airspeed
from fusetune.analyze.diagnosis.motion import Motion
from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.metrics.grouping import distinct, rows_of
from fusetune.px4.flight import Flight

Array = npt.NDArray[np.float64]

LEAST_M_S = 2.5
BLOCK_S = 3.0
SPEED_NOISE_M_S, WIND_M_S = 0.5, 6.0
"""What is expected of the wind, against the noise of a reading: a flight along one line does not tell it from scale."""
FEWEST, FEWEST_BLOCKS = 30, 3


@dataclass(frozen=True)
class AirspeedSigns:
    """Measured airspeed over what the motion makes; `wind` (2,) is north and east, m/s, of constant wind."""

    scale: float
    error: float
    wind: Array
    samples: int


def airspeed_signs(flight: Flight, motion: Motion, airborne: tuple[Interval, ...]) -> AirspeedSigns | None:
    """Fit scale and wind; None without airspeed, or where the flight does not tell them apart.

    A pitot tube along the forward axis feels what of the air comes along it: f·(v − w) = s/k, f the forward axis, v the
    velocity, w the wind, s the reading and k its scale; linear in 1/k and w.
    """
    measured = measured_airspeed(flight)
    if measured is None:
        return None
    time, speed = measured
    usable = inside(time, airborne) & (time > motion.time[0]) & (time < motion.time[-1])
    usable &= np.abs(speed) > LEAST_M_S
    time, speed = time[usable], speed[usable]
    if time.size < FEWEST:
        return None
    velocity = motion.at(time, motion.velocity)
    off = np.interp(time, motion.time, motion.heading_off)
    forward = motion.at(time, motion.rotation[:, :, 0])
    cosine, sine = np.cos(off), np.sin(off)
    north, east = cosine * forward[:, 0] - sine * forward[:, 1], sine * forward[:, 0] + cosine * forward[:, 1]
    along = north * velocity[:, 0] + east * velocity[:, 1] + forward[:, 2] * velocity[:, 2]
    design = np.column_stack([speed, north, east])
    block = ((time - time[0]) * 1e-6 / BLOCK_S).astype(np.int64)
    blocks = distinct(block)
    if blocks.size < FEWEST_BLOCKS:
        return None
    normal, moment = design.T @ design, design.T @ along
    normal += np.diag([0.0, *[(SPEED_NOISE_M_S / WIND_M_S) ** 2] * 2])
    solution = np.linalg.solve(normal, moment)
    without = []
    for own in rows_of(block, blocks):
        part = design[own]
        without.append(np.linalg.lstsq(normal - part.T @ part, moment - part.T @ along[own], rcond=None)[0][0])
    error = float(np.sqrt((blocks.size - 1) / blocks.size * np.sum((np.array(without) - np.mean(without)) ** 2)))
    if solution[0] < 0.1:
        return None
    scale = 1.0 / float(solution[0])
    return AirspeedSigns(scale, error * scale**2, solution[1:], time.size)
