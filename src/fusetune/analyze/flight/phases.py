"""When the vehicle flew, and where the log has gaps: from the flight's own topics."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Interval, stretches
from fusetune.px4.flight import Flight

IMU_TOPICS = ("sensor_combined", "vehicle_imu")
"""Topics that show gaps in the IMU samples; the first that a log holds."""


def intervals_where(time: npt.NDArray[np.int64], active: npt.NDArray[np.bool_], last_time: int) -> tuple[Interval, ...]:
    """Intervals in which a flag, logged at its changes or regularly, is true.

    Parameters
    ----------
    time : (N,) µs, ascending
    active : (N,) value of the flag from each time on
    last_time : end of the log, µs
    """
    if time.size == 0:
        return ()
    times = np.r_[time, max(last_time, int(time[-1]))]
    return tuple((int(times[a]), int(times[b])) for a, b in stretches(active))


def airborne_intervals(flight: Flight, flags: Mapping[str, npt.NDArray[Any]]) -> tuple[Interval, ...]:
    """Flight time, µs.

    Parameters
    ----------
    flags : status flags of a replay; `cs_in_air` serves where the log has no land detector
    """
    table = flight.topic("vehicle_land_detected")
    if table is not None and "landed" in table and table["timestamp"].size:
        time = table["timestamp"].astype(np.int64)
        return intervals_where(time, table["landed"].astype(np.int64) == 0, flight.last_timestamp)
    if "cs_in_air" in flags and flags["timestamp"].size:
        return intervals_where(flags["timestamp"].astype(np.int64), flags["cs_in_air"], flight.last_timestamp)
    return ()


def imu_gaps(flight: Flight, longer_than_s: float) -> tuple[Interval, ...]:
    """Gaps in the IMU samples of the log, µs: dropouts of the logger, among others."""
    for topic in IMU_TOPICS:
        table = flight.topic(topic)
        if table is not None and table["timestamp"].size > 1:
            time = table["timestamp"].astype(np.int64)
            before = np.flatnonzero(np.diff(time) > longer_than_s * 1e6)
            return tuple((int(time[i]), int(time[i + 1])) for i in before)
    return ()
