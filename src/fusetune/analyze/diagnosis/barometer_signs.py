"""A barometer against inertial height and GNSS height."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.diagnosis.gnss_signs import has_fix
from fusetune.analyze.diagnosis.height_errors import HeightErrors, height_errors
from fusetune.analyze.diagnosis.motion import Motion, climbed_by
from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.ekf2.feed.message_samples import baro_samples
from fusetune.px4.flight import Flight

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

BEFORE_US, AFTER_US = 8_000_000, 3_000_000
MEAN_OVER_S = 5.0


@dataclass(frozen=True)
class BarometerSigns:
    """What a barometer's height follows, and what it drifts by.

    Attributes
    ----------
    errors : what it follows besides the height (`height_errors`); None where the flight does not tell
    noise : robust white noise of a reading, m
    drift : largest change of five-second means against GNSS height, less what `errors` explain, m; NaN without GNSS
    drift_error : how much of that may be GNSS, m
    inertial_drift : the change between the same two times against the integrated vertical velocity, m
    drifted : between which times, µs
    """

    errors: HeightErrors | None
    noise: float
    drift: float
    drift_error: float
    inertial_drift: float
    drifted: Interval | None


def barometer_signs(
    flight: Flight,
    motion: Motion,
    airborne: tuple[Interval, ...],
    stuck: Interval | None = None,
    wind: Array | None = None,
) -> BarometerSigns | None:
    """Look at the barometer, but for the time in which it was stuck, µs; None without one.

    Parameters
    ----------
    wind : as `height_errors` takes it
    """
    table = flight.topic("vehicle_air_data")
    if table is None:
        return None
    samples, _ = baro_samples(table)
    time, height = samples["time_us"].astype(np.int64), samples["hgt"]
    if stuck is not None:
        works = (time < stuck[0]) | (time > stuck[1])
        time, height = time[works], height[works]
    around = ((airborne[0][0] - BEFORE_US, airborne[-1][1] + AFTER_US),)
    climbed = climbed_by(motion.time, motion.velocity)
    errors = height_errors(time, height, motion, around, climbed, wind)
    rows = inside(time, airborne) & (time > motion.time[0]) & (time < motion.time[-1])
    if np.count_nonzero(rows) < 20:
        return None
    # third differences leave nothing of flight and drift; of white noise they are 20 times its variance
    rest = np.diff(height[rows], n=3)
    noise = float(np.median(np.abs(rest))) / 0.6745 / np.sqrt(20.0)
    return BarometerSigns(errors, noise, *_drift(flight, motion, time[rows], height[rows], errors, climbed))


def _drift(
    flight: Flight, motion: Motion, time: Times, height: Array, errors: HeightErrors | None, climbed: Array
) -> tuple[float, float, float, Interval | None]:
    nothing = float("nan"), float("nan"), float("nan"), None
    table = flight.topic("vehicle_gps_position")
    if table is None or "altitude_msl_m" not in table:
        return nothing
    good = has_fix(table) & np.isfinite(table["altitude_msl_m"])
    at, altitude = table["timestamp"][good].astype(np.int64), table["altitude_msl_m"][good].astype(np.float64)
    if at.size < 20:
        return nothing
    height = height - (errors.explained(time, motion) if errors is not None else 0.0)
    inside_fix = (time > at[0]) & (time < at[-1])
    time, height = time[inside_fix], height[inside_fix]
    if time.size < 20:
        return nothing
    against_gnss = height - np.interp(time, at, altitude)
    against_imu = height - motion.at(time, climbed)
    block = ((time - time[0]) * 1e-6 / MEAN_OVER_S).astype(np.int64)
    ones, counts = np.unique(block, return_counts=True)
    ones = ones[counts >= 3]
    if ones.size < 3:
        return nothing
    gnss, imu, when = (
        np.array([np.median(values[block == one]) for one in ones]) for values in (against_gnss, against_imu, time)
    )
    low, high = int(np.argmin(gnss)), int(np.argmax(gnss))
    first, last = min(low, high), max(low, high)
    change = float(gnss[last] - gnss[first])
    # what GNSS height wanders by shows in how it moves against the inertial height
    wander = float(np.std(np.diff(gnss - imu))) * np.sqrt(max(last - first, 1))
    return change, wander, float(imu[last] - imu[first]), (int(when[first]), int(when[last]) + 1)
