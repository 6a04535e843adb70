"""Positions and heights as the smoother takes them: against the integral of the estimated velocity, at its epochs.

Heights are those of the log. As the filter takes them, its own estimate of their bias is subtracted, which is made of
its state: a reference made of them would lean to the set that is replayed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.metrics.attitude import interpolate_quaternion
from fusetune.analyze.replaying.measurement_times import match
from fusetune.analyze.replaying.replayed_set import FilterStates, ReplayedSet
from fusetune.analyze.sensors.measurement_errors import ErrorSeries, measurement_errors, travelled_way
from fusetune.analyze.smoothing.velocity_models import DOWN, PLANE, PositionSeries
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.px4.flight import Flight
from fusetune.quaternions import rotation_matrix

Array = npt.NDArray[np.float64]

TAKEN = {"gnss_pos": PLANE, "gnss_hgt": DOWN, "baro_hgt": DOWN}
"""Sources beside the velocity, and their axes."""
WITH_VELOCITY = {"gnss_vel": ("gnss_pos", "gnss_hgt")}
"""Source of velocity → those that stand in the same message."""


LOGGED_HEIGHTS = {
    "gnss_hgt": ("vehicle_gps_position", "timestamp", "altitude_msl_m"),
    "baro_hgt": ("vehicle_air_data", "timestamp_sample", "baro_alt_meter"),
}
"""Source of heights → topic, when a message of it was measured, and the height, m."""
_MATCH_SHARE = 0.75
"""Of the time from one message to the next. The filter shifts samples by half of its own interval."""


@dataclass(frozen=True)
class MeasuredPositions:
    """A source of positions or heights on a flight; `values` (M, 2 or 1), NED, m, at `time` (M,), µs."""

    source: str
    is_delayed: bool
    time: npt.NDArray[np.int64]
    values: Array

    def at(self, epochs: npt.NDArray[np.int64]) -> PositionSeries:
        """Means around times (N,), µs, each up to half-way to the next one; against their own mean."""
        half_way = (epochs[1:] + epochs[:-1]) // 2
        ends = np.r_[epochs[0] - (half_way[0] - epochs[0]), half_way, epochs[-1] + (epochs[-1] - half_way[-1])]
        place = np.searchsorted(ends, self.time, side="right") - 1
        rows = (place >= 0) & (place < epochs.size)
        count = np.bincount(place[rows], minlength=epochs.size)
        with np.errstate(invalid="ignore"):
            means = np.column_stack(
                [np.bincount(place[rows], one, minlength=epochs.size) / count for one in self.values[rows].T]
            )
        known = np.isfinite(means)
        centre = means[known.all(axis=1)].mean(axis=0) if known.any() else 0.0
        return PositionSeries(self.source, TAKEN[self.source], means - centre, self.is_delayed)


def position_series(record: ReplayedSet, flight: Flight, velocity_source: str) -> list[MeasuredPositions]:
    """The positions and heights that a replay took.

    Parameters
    ----------
    record : replay; its velocities are integrated
    flight : canonical; gives GNSS positions, and heights as they were logged where it has their topics
    velocity_source : the one that is smoothed
    """
    states = record.states()
    found = []
    for source in TAKEN:
        series = measurement_errors(record, states, flight, source)
        if series is not None and series.time.size:
            if source == "gnss_pos":
                series = _at_the_imu(series, states, record)
            if source in LOGGED_HEIGHTS:
                series = _as_logged(series, source, states, record, flight)
            delayed = source in WITH_VELOCITY.get(velocity_source, ())
            found.append(MeasuredPositions(source, delayed, series.time, series.values))
    return found


def _as_logged(
    series: ErrorSeries, source: str, states: FilterStates, record: ReplayedSet, flight: Flight
) -> ErrorSeries:
    """The same measurements as they stand in the log; the series itself where they do not."""
    topic, stamp, field = LOGGED_HEIGHTS[source]
    table = flight.topic(topic)
    if table is None or not {stamp, field} <= set(table) or table[stamp].size < 2:
        return series
    logged = table[stamp].astype(np.int64)
    delay = AID_SOURCES[source].delay_parameter
    time = series.time + round(record.parameters.get(delay or "", 0.0) * 1e3)
    row = match(time, logged, _MATCH_SHARE * float(np.median(np.diff(logged))))
    height = table[field][row].astype(np.float64)
    usable = (row >= 0) & np.isfinite(height)
    if not usable.any():
        return series
    values = -height - travelled_way(states, series.time)[:, 2]
    return ErrorSeries(series.time[usable], values[usable, None])


def _at_the_imu(series: ErrorSeries, states: FilterStates, record: ReplayedSet) -> ErrorSeries:
    """Positions of the antenna less its lever arm, which turns with the vehicle."""
    arm = [record.parameters.get(f"EKF2_GPS_POS_{axis}", 0.0) for axis in "XYZ"]
    imu = [record.parameters.get(f"EKF2_IMU_POS_{axis}", 0.0) for axis in "XYZ"]
    turn = rotation_matrix(interpolate_quaternion(states.time, states.quaternion, series.time))
    return ErrorSeries(series.time, series.values - (turn @ np.subtract(arm, imu))[:, :2])
