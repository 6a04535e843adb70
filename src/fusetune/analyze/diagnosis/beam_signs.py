"""A range finder against the vehicle's own climbing: constant readings, steps without motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.diagnosis.motion import Motion
from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.ekf2.feed.message_samples import range_samples
from fusetune.px4.flight import Flight

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

STEP_M, STEP_SIGMAS, AROUND = 0.2, 8.0, 5
"""A step is between the medians of some readings before and after."""
SHORT_SHARE = 0.6
"""A reading below this share of the height is of something nearer than the ground."""
SAME_M = 0.03
LEAST_HEIGHT_M = 1.5


@dataclass(frozen=True)
class RangeSigns:
    """Of the range finder that looks down, in the air above `LEAST_HEIGHT_M`.

    Attributes
    ----------
    samples : used
    steps : times at which the distance jumped by more than the vehicle moved, µs, and by how much, m
    short_share : readings far below the height, of all
    constant_share : of the short ones, how many are within `SAME_M` of their median
    short : from the first to the last of them, µs
    short_m : their median, m
    noise : of a reading, m
    """

    samples: int
    steps: tuple[tuple[int, float], ...]
    short_share: float
    constant_share: float
    short: Interval | None
    short_m: float
    noise: float


def range_signs(flight: Flight, motion: Motion, airborne: tuple[Interval, ...]) -> RangeSigns | None:
    """Look at the range finder; None without one, or where the vehicle stayed near the ground."""
    for instance in range(4):
        table = flight.topics.get(("distance_sensor", instance))
        if table is not None and np.any(table.get("orientation", np.full(1, 25)) == 25):
            break
    else:
        return None
    samples, _ = range_samples(table)
    time, distance, good = samples["time_us"].astype(np.int64), samples["range"], samples["quality"] != 0
    height = motion.at(time, motion.height)
    good &= inside(time, airborne) & (time > motion.time[0]) & (time < motion.time[-1]) & np.isfinite(distance)
    good &= height > LEAST_HEIGHT_M
    if np.count_nonzero(good) < 20:
        return None
    time, height = time[good], height[good]
    level = distance[good] * motion.at(time, motion.rotation[:, 2, 2])
    step = np.median(np.diff(time))
    near = np.diff(time) < 2.5 * step
    off = level - height
    noise = float(np.median(np.abs(np.diff(off)[near]))) / 0.6745 / np.sqrt(2.0) if near.any() else 0.0
    found, change = _steps(off, near, max(STEP_M, STEP_SIGMAS * noise * MEDIAN_ERROR))
    # where most readings are of something else the height of the ground is that of the largest
    ground = float(np.percentile(off, 80.0))
    short = level < SHORT_SHARE * (height + ground)
    values = distance[good][short]
    middle = float(np.median(values)) if values.size else 0.0
    rows = np.flatnonzero(short)
    return RangeSigns(
        samples=time.size,
        steps=tuple((int(time[i]), float(change[i])) for i in found),
        short_share=float(np.mean(short)),
        constant_share=float(np.mean(np.abs(values - middle) < SAME_M)) if values.size else 0.0,
        short=(int(time[rows[0]]), int(time[rows[-1]]) + 1) if rows.size else None,
        short_m=middle,
        noise=noise,
    )


SURROUNDINGS = 15
MEDIAN_ERROR = float(np.sqrt(2.0 * np.pi / 2.0 / AROUND))
"""Standard error of the difference of two medians, for noise of 1."""


def _steps(off: Array, near: npt.NDArray[np.bool_], limit: float) -> tuple[npt.NDArray[np.int64], Array]:
    """Places where the median of the readings after differs most from that before, and by how much, (N,)."""
    change = np.zeros(off.size)
    if off.size <= 2 * AROUND:
        return np.zeros(0, np.int64), change
    middle = np.median(np.lib.stride_tricks.sliding_window_view(off, AROUND), axis=1)
    change[AROUND : off.size - AROUND + 1] = middle[AROUND:] - middle[:-AROUND]
    whole = np.convolve(near, np.ones(2 * AROUND - 1), mode="same")[: off.size - 1] >= 2 * AROUND - 1
    change[1:] = np.where(whole, change[1:], 0.0)
    # a climb that is known badly makes every place alike; a step is a place of its own
    wide = 2 * SURROUNDINGS + 1
    around = np.lib.stride_tricks.sliding_window_view(np.pad(change, SURROUNDINGS, mode="edge"), wide)
    change = change - np.median(around, axis=1)
    size = np.abs(change)
    largest = np.lib.stride_tricks.sliding_window_view(np.pad(size, AROUND), 2 * AROUND + 1).max(axis=1)
    return np.flatnonzero((size > limit) & (size == largest)), change
