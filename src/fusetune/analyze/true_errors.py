"""Errors against a known truth (`*_groundtruth` topics of a simulation), on the scored part of the flight."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fusetune.analyze.consistency import paper_bounds
from fusetune.analyze.scoring_window import ScoringWindow
from fusetune.analyze.set_files import SetRecord, read_columns
from fusetune.ekf2 import state
from fusetune.px4.flight import Flight, TopicTable, stacked

Array = npt.NDArray[np.float64]

EARTH_RADIUS_M = 6371000.0
"""Radius of PX4's map projection."""

_SLOWEST_TRACK_M_S = 0.5
"""Below this ground speed there is no direction to split an error along."""


@dataclass(frozen=True)
class Truth:
    """Ground truth in the log; time µs, NED m and m/s, quaternion (w, x, y, z) body → NED."""

    time: npt.NDArray[np.int64]
    position: Array
    velocity: Array
    attitude_time: npt.NDArray[np.int64]
    quaternion: Array
    reference: tuple[float, float, float] | None


@dataclass(frozen=True)
class ErrorFigure:
    """One figure of the true error: quantity, axis, metric and value over n samples."""

    quantity: str
    axis: str
    metric: str
    value: float
    n: int
    lower: float = np.nan
    upper: float = np.nan


def read_truth(flight: Flight) -> Truth | None:
    """Ground truth of a flight, or None where the log has none."""
    local = flight.topic("vehicle_local_position_groundtruth")
    attitude = flight.topic("vehicle_attitude_groundtruth")
    if local is None or local["timestamp"].size < 2:
        return None
    reference = None
    if all(name in local for name in ("ref_lat", "ref_lon", "ref_alt")) and np.any(local["ref_lat"] != 0.0):
        reference = (float(local["ref_lat"][-1]), float(local["ref_lon"][-1]), float(local["ref_alt"][-1]))
    has_attitude = attitude is not None and attitude["timestamp"].size > 1
    return Truth(
        time=_time(local),
        position=np.column_stack([local[name] for name in ("x", "y", "z")]).astype(np.float64),
        velocity=np.column_stack([local[name] for name in ("vx", "vy", "vz")]).astype(np.float64),
        attitude_time=_time(attitude) if attitude is not None and has_attitude else np.zeros(0, dtype=np.int64),
        quaternion=stacked(attitude, "q") if attitude is not None and has_attitude else np.zeros((0, 4)),
        reference=reference,
    )


def _time(table: TopicTable) -> npt.NDArray[np.int64]:
    sample = table.get("timestamp_sample")
    time = table["timestamp"] if sample is None or not np.all(sample > 0) else sample
    return time.astype(np.int64)


def true_errors(
    record: SetRecord, folder: Path, truth: Truth, window: ScoringWindow, confidence: float
) -> list[ErrorFigure]:
    """All figures of one replay against the truth.

    Parameters
    ----------
    folder : holds `<set>.states.parquet`
    window : only these times count, alike for all sets

    Returns
    -------
    Position (m; absolute where both origins are known, and with the mean removed), velocity (m/s), attitude (deg:
    tilt, heading, total rotation) and NEES of the velocity with its χ² bounds
    """
    figures: list[ErrorFigure] = []
    local = record.local_position
    # The output predictor carries the state from the fusion horizon to `timestamp`; that is when it holds.
    time = local["timestamp"].astype(np.int64)
    rows = window.contains(time) & (time >= truth.time[0]) & (time <= truth.time[-1])
    if np.count_nonzero(rows) > 1:
        time = time[rows]
        velocity = np.column_stack([local[name][rows] for name in ("vx", "vy", "vz")]).astype(np.float64)
        true_velocity = interpolate(truth.time, truth.velocity, time)
        figures += vector_figures("velocity", velocity - true_velocity, true_velocity)
        position = np.column_stack([local[name][rows] for name in ("x", "y", "z")]).astype(np.float64)
        error = position - interpolate(truth.time, truth.position, time)
        offset = _origin_offset(record, truth)
        if offset is not None:
            figures += vector_figures("position", error + offset, true_velocity)
        figures += vector_figures("position_mean_removed", error - error.mean(axis=0), true_velocity)
    return figures + _state_figures(record.name, folder, truth, window, confidence)


def _origin_offset(record: SetRecord, truth: Truth) -> Array | None:
    origin = record.summary.get("origin")
    if not origin or truth.reference is None:
        return None
    latitude, longitude, altitude = truth.reference
    north = np.radians(origin["latitude_deg"] - latitude) * EARTH_RADIUS_M
    east = np.radians(origin["longitude_deg"] - longitude) * EARTH_RADIUS_M * np.cos(np.radians(latitude))
    return np.array([north, east, altitude - origin["altitude_m"]])


def _state_figures(
    name: str, folder: Path, truth: Truth, window: ScoringWindow, confidence: float
) -> list[ErrorFigure]:
    columns = ["timestamp_sample"]
    columns += [f"states_{i}" for i in range(state.PUBLISHED_VELOCITY + 3)]
    columns += [f"covariances_{i}" for i in range(state.VELOCITY, state.VELOCITY + 3)]
    table = read_columns(folder / f"{name}.states.parquet", columns)
    time = table["timestamp_sample"].astype(np.int64)
    rows = window.contains(time) & (time >= truth.time[0]) & (time <= truth.time[-1])
    figures: list[ErrorFigure] = []
    if np.count_nonzero(rows) < 2:
        return figures
    first = state.PUBLISHED_VELOCITY
    velocity = np.column_stack([table[f"states_{first + i}"][rows] for i in range(3)]).astype(np.float64)
    variance = np.column_stack([table[f"covariances_{state.VELOCITY + i}"][rows] for i in range(3)]).astype(np.float64)
    error = velocity - interpolate(truth.time, truth.velocity, time[rows])
    if np.all(variance > 0.0):
        nees = np.mean(np.sum(np.square(error) / variance, axis=1))
        bounds = paper_bounds(nees, error.shape[0], 3, confidence)
        limits = float(bounds.lower), float(bounds.upper)
        figures.append(ErrorFigure("velocity", "all", "nees", float(nees), error.shape[0], *limits))
    if truth.attitude_time.size:
        inside = rows & (time >= truth.attitude_time[0]) & (time <= truth.attitude_time[-1])
        if np.count_nonzero(inside) > 1:
            quaternion = np.column_stack([table[f"states_{i}"][inside] for i in range(4)]).astype(np.float64)
            figures += attitude_figures(
                quaternion, interpolate_quaternion(truth.attitude_time, truth.quaternion, time[inside])
            )
    return figures


def interpolate(time: npt.NDArray[np.int64], values: Array, at: npt.NDArray[np.int64]) -> Array:
    """Linear interpolation of (N, D) values at times (M,), µs → (M, D)."""
    return np.column_stack([np.interp(at, time, column) for column in values.T])


def interpolate_quaternion(time: npt.NDArray[np.int64], quaternion: Array, at: npt.NDArray[np.int64]) -> Array:
    """Normalised linear interpolation of unit quaternions (N, 4), fit for the small steps of a log → (M, 4)."""
    flips = np.cumprod(np.where(np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0.0, -1.0, 1.0))
    continuous = quaternion * np.r_[1.0, flips][:, None]
    result = interpolate(time, continuous, at)
    return result / np.linalg.norm(result, axis=1, keepdims=True)


def vector_figures(quantity: str, error: Array, true_velocity: Array) -> list[ErrorFigure]:
    """Figures of a NED error (N, 3): per axis, horizontal, 3-D, along and across the true track.

    RMSE; average Euclidean, harmonic and geometric error; maximum of the norm.

    References
    ----------
    García, Molina, Trincado, table 1; Li and Zhao, "Practical measures for performance evaluation", 2001.
    """
    count = error.shape[0]
    components = {"x": error[:, 0], "y": error[:, 1], "z": error[:, 2]}
    speed = np.hypot(true_velocity[:, 0], true_velocity[:, 1])
    moving = speed > _SLOWEST_TRACK_M_S
    if moving.any():
        direction = true_velocity[moving, :2] / speed[moving, None]
        components["along_track"] = np.sum(error[moving, :2] * direction, axis=1)
        components["cross_track"] = error[moving, 1] * direction[:, 0] - error[moving, 0] * direction[:, 1]
    figures = [
        ErrorFigure(quantity, axis, "rmse", float(np.sqrt(np.mean(np.square(values)))), values.size)
        for axis, values in components.items()
    ]
    for axis, norm in (("horizontal", np.hypot(error[:, 0], error[:, 1])), ("all", np.linalg.norm(error, axis=1))):
        positive = np.maximum(norm, 1e-12)
        values = {
            "rmse": np.sqrt(np.mean(np.square(norm))),
            "average_euclidean_error": np.mean(norm),
            "harmonic_error": 1.0 / np.mean(1.0 / positive),
            "geometric_error": np.exp(np.mean(np.log(positive))),
            "maximum_error": np.max(norm),
        }
        figures += [ErrorFigure(quantity, axis, metric, float(value), count) for metric, value in values.items()]
    return figures


def attitude_figures(quaternion: Array, true_quaternion: Array) -> list[ErrorFigure]:
    """RMSE of tilt, heading and total rotation, deg, of unit quaternions (N, 4), (w, x, y, z) body → NED."""
    heading = _wrap(_heading(quaternion) - _heading(true_quaternion))
    dot = np.clip(np.abs(np.sum(quaternion * true_quaternion, axis=1)), 0.0, 1.0)
    tilt = np.arccos(np.clip(np.sum(_down(quaternion) * _down(true_quaternion), axis=1), -1.0, 1.0))
    errors = {"heading": heading, "tilt": tilt, "all": 2.0 * np.arccos(dot)}
    return [
        ErrorFigure("attitude_deg", axis, "rmse", float(np.degrees(np.sqrt(np.mean(np.square(error))))), error.size)
        for axis, error in errors.items()
    ]


def _heading(q: Array) -> Array:
    w, x, y, z = q.T
    return np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _down(q: Array) -> Array:
    """The down axis of NED seen from the body, (N, 3)."""
    w, x, y, z = q.T
    return np.column_stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)])


def _wrap(angle: Array) -> Array:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
