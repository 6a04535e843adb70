"""The track of a flown flight: the motion as the vehicle's own estimator tells it, from the log."""

from __future__ import annotations

import numpy as np

from fusetune.design.covariance.track import Origin, Track
from fusetune.errors import UserError
from fusetune.px4.flight import Flight, TopicTable, row_count, stacked
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.ulog.reader import read_ulog
from fusetune.quaternions import normalised
from fusetune.storage.files import AnyPath

_NEEDED = ("sensor_combined", "vehicle_attitude", "vehicle_local_position", "vehicle_land_detected")


def logged_track(log: AnyPath) -> Track:
    """The track of a log.

    Raises
    ------
    UserError
        The log cannot be read, or does not tell where the vehicle was.
    """
    flight = canonical(read_ulog(log))
    for topic in _NEEDED:
        table = flight.topic(topic)
        if table is None or row_count(table) < 2:
            raise UserError(log, f"holds no {topic}, without which there is no track", "Name another log")
    return track_of_flight(flight, log)


def track_of_flight(flight: Flight, log: AnyPath) -> Track:
    """The track of a flight in the layout of v1.16, from the first to the last time at which its place is known.

    Raises
    ------
    UserError
        The place on the earth is never known.
    """
    imu, attitude, place, land = (_table(flight, name) for name in _NEEDED)
    known = np.isfinite(place["ref_lat"]) & (place["ref_timestamp"] > 0) & place["xy_valid"].astype(np.bool_)
    if not known.any():
        raise UserError(log, "its vehicle never knew its place on the earth", "Name a log of a flight with GNSS")
    first = int(np.flatnonzero(known)[0])
    start_us, stop_us = place["timestamp"][[0, -1]]
    rows = (imu["timestamp"] >= start_us) & (imu["timestamp"] <= stop_us)
    rows &= np.concatenate([[True], np.diff(imu["timestamp"].astype(np.int64)) > 0])
    time_us = imu["timestamp"][rows].astype(np.int64)
    bias = flight.topic("estimator_sensor_bias")
    return Track(
        timestamp_us=time_us,
        attitude=_attitude(time_us, attitude),
        velocity=_columns(time_us, place, ("vx", "vy", "vz")),
        position=_columns(time_us, place, ("x", "y", "z")),
        specific_force=stacked(imu, "accelerometer_m_s2")[rows] - _bias(time_us, bias, "accel_bias"),
        angular_rate=stacked(imu, "gyro_rad")[rows] - _bias(time_us, bias, "gyro_bias"),
        in_air=_held(time_us, land, "landed") == 0,
        at_rest=_held(time_us, land, "at_rest") > 0,
        origin=Origin(float(place["ref_lat"][first]), float(place["ref_lon"][first]), float(place["ref_alt"][first])),
        name=flight.name,
    )


def _table(flight: Flight, name: str) -> TopicTable:
    return flight.topics[name, 0]


def _attitude(time_us: np.ndarray, table: TopicTable) -> np.ndarray:
    q = stacked(table, "q")
    signs = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))
    q[1:] *= signs[:, None]
    return np.asarray(normalised(np.stack([np.interp(time_us, table["timestamp"], part) for part in q.T], axis=-1)))


def _columns(time_us: np.ndarray, table: TopicTable, names: tuple[str, ...]) -> np.ndarray:
    return np.stack([np.interp(time_us, table["timestamp"], table[name].astype(np.float64)) for name in names], axis=-1)


def _bias(time_us: np.ndarray, table: TopicTable | None, name: str) -> np.ndarray:
    """Bias that the estimator had learned, (N, 3); 0 where the log does not tell."""
    if table is None or f"{name}[0]" not in table or not row_count(table):
        return np.zeros((len(time_us), 3))
    values = stacked(table, name)
    return np.nan_to_num(np.stack([np.interp(time_us, table["timestamp"], part) for part in values.T], axis=-1))


def _held(time_us: np.ndarray, table: TopicTable, name: str) -> np.ndarray:
    """The newest value of a flag at each time; releases that do not have it say 0."""
    if name not in table:
        return np.zeros(len(time_us))
    row = np.maximum(np.searchsorted(table["timestamp"], time_us, side="right") - 1, 0)
    return np.asarray(table[name][row], dtype=np.float64)
