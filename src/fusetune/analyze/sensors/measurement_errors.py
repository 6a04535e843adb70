"""Each measurement against the inertial motion: its error, up to the slow drift of the inertial solution.

An innovation mixes the error of the measurement with that of the state, and the state follows the measurement itself:
innovations of a filter that trusts a wandering source look white. So what the source itself told the filter is taken
out again, and what remains is y(t) = e(t) + drift(t), the error e of the measurement plus a smooth drift of the
inertial solution that all parameter sets have nearly in common.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.replaying.measurement_times import match, measurement_time
from fusetune.analyze.replaying.replayed_set import FilterStates, ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples
from fusetune.ekf2.numerics.constants import RADIUS_OF_EARTH
from fusetune.px4.aid_sources import AID_SOURCES, MEASURED_SOURCES
from fusetune.px4.flight import Flight
from fusetune.quaternions import rotation_matrix

Array = npt.NDArray[np.float64]


def _sources(quantity: str) -> tuple[str, ...]:
    """Sources of the replay that measure a quantity."""
    return tuple(one.name for one in MEASURED_SOURCES.values() if one.quantity == quantity and one.is_replayed)


VELOCITY_SOURCES, HEADING_SOURCES = _sources("velocity"), _sources("heading")
PLANE_SOURCES, HEIGHT_SOURCES = _sources("position"), _sources("height")
COVERED = (*VELOCITY_SOURCES, *HEADING_SOURCES, *PLANE_SOURCES, *HEIGHT_SOURCES, "mag")
"""Sources for which `measurement_errors` finds a series."""

_MATCH_SHARE = 0.4
_FOREIGN_CORRECTION = 10.0


@dataclass(frozen=True)
class ErrorSeries:
    """Errors of one source up to the drift of the inertial solution; `time` (N,) µs, `values` (N, D)."""

    time: npt.NDArray[np.int64]
    values: Array


def measurement_errors(record: ReplayedSet, states: FilterStates, flight: Flight, source: str) -> ErrorSeries | None:
    """Series of a source, unit of the source, from the first sample that was fused.

    * Velocity: y_k = −ν_k + Σ_{j<k} c_j, where c_j is how much the update at measurement j moved the state. Adding
      the corrections back leaves the inertial solution running freely.
    * Heading: −ν_k. Gyros hold a heading for many seconds, and the other source of heading that most vehicles have
      would answer the corrections that were taken out.
    * Position and height: the measurement less the integral of the estimated velocity; heights count downwards.
    * Magnetometer: the measurement less Rᵀ(q) m + b, with the constant earth field m and body bias b that fit best.

    Parameters
    ----------
    flight : canonical; `vehicle_gps_position` gives GNSS positions, which the innovations table holds only coarsely

    Returns
    -------
    ErrorSeries, or None where the source was never fused, has an axis missing or cannot be brought to this form
    """
    axes = [record.samples.get((source, axis)) for axis in range(AID_SOURCES[source].axes)]
    samples = [one for one in axes if one is not None and one.fused.any()]
    if source not in COVERED or len(samples) != AID_SOURCES[source].axes or states.time.size < 3:
        return None
    if any(one.timestamp_sample.size != samples[0].timestamp_sample.size for one in samples):
        return None
    first = int(np.argmax(samples[0].fused))
    time = samples[0].timestamp_sample[first:]
    innovation = np.column_stack([one.innovation[first:] for one in samples])
    values = _values(record, states, flight, source, samples, time, innovation, first)
    if values is None:
        return None
    usable = np.isfinite(values).all(axis=1) & (time >= states.time[0]) & (time <= states.time[-1])
    return ErrorSeries(time[usable], values[usable])


def _values(
    record: ReplayedSet,
    states: FilterStates,
    flight: Flight,
    source: str,
    samples: list[AxisSamples],
    time: npt.NDArray[np.int64],
    innovation: Array,
    first: int,
) -> Array | None:
    if source == "gnss_pos":
        measured = _gnss_positions(flight, measurement_time(samples[0], source, record.parameters)[first:])
        return None if measured is None else measured - travelled_way(states, time)[:, :2]
    if any(one.observation.size != one.innovation.size for one in samples):
        return None
    observation = np.column_stack([one.observation[first:] for one in samples])
    if source in VELOCITY_SOURCES:
        update = np.minimum(np.searchsorted(states.time, time), states.time.size - 1)
        after = states.velocity[update, : innovation.shape[1]]
        return _running_freely(innovation, after - (observation + innovation))
    if source in HEADING_SOURCES:
        return -innovation
    if source == "mag":
        return _mag_errors(states, time, observation)
    travelled = travelled_way(states, time)
    if source in PLANE_SOURCES:
        return observation - travelled[:, :2]
    return _height_sign(observation + innovation, travelled[:, 2:]) * observation - travelled[:, 2:]


def _running_freely(innovation: Array, correction: Array) -> Array | None:
    # An observation in another frame than the state's shows as corrections that innovations cannot explain.
    if np.nanmedian(np.abs(correction)) > _FOREIGN_CORRECTION * max(np.nanmedian(np.abs(innovation)), 1e-9):
        return None
    own = np.cumsum(np.nan_to_num(correction), axis=0)
    return -innovation + own - np.nan_to_num(correction)


def travelled_way(states: FilterStates, at: npt.NDArray[np.int64]) -> Array:
    """Integral of the estimated velocity (trapezoids), NED m, (N, 3)."""
    step = np.diff(states.time)[:, None] * 1e-6
    way = np.cumsum(0.5 * (states.velocity[1:] + states.velocity[:-1]) * step, axis=0)
    way = np.vstack([np.zeros(3), way])
    return np.column_stack([np.interp(at, states.time, column) for column in way.T])


def _gnss_positions(flight: Flight, time: npt.NDArray[np.int64]) -> Array | None:
    """North and east of the receiver's first position, m; NaN where the log has no row for a measurement."""
    table = flight.topic("vehicle_gps_position")
    if table is None or "latitude_deg" not in table or table["timestamp"].size < 2:
        return None
    logged = table["timestamp"].astype(np.int64)
    row = match(time, logged, _MATCH_SHARE * float(np.median(np.diff(logged))))
    latitude, longitude = np.radians(table["latitude_deg"][row]), np.radians(table["longitude_deg"][row])
    if not (row >= 0).any():
        return None
    origin = int(np.argmax(row >= 0))
    north = (latitude - latitude[origin]) * RADIUS_OF_EARTH
    east = (longitude - longitude[origin]) * RADIUS_OF_EARTH * np.cos(latitude[origin])
    return np.where((row >= 0)[:, None], np.column_stack([north, east]), np.nan)


def _height_sign(predicted: Array, down: Array) -> float:
    """+1 where a source measures down, −1 where it measures up, by which of them its predictions follow."""
    change, fall = np.diff(predicted, axis=0), np.diff(down, axis=0)
    return 1.0 if np.nansum(change * fall) >= 0.0 else -1.0


def _mag_errors(states: FilterStates, time: npt.NDArray[np.int64], observation: Array) -> Array:
    update = np.minimum(np.searchsorted(states.time, time), states.time.size - 1)
    to_body = np.swapaxes(rotation_matrix(states.quaternion[update]), 1, 2)
    usable = np.isfinite(observation).all(axis=1)
    design = np.concatenate([to_body, np.broadcast_to(np.eye(3), to_body.shape)], axis=2)
    rows = design[usable].reshape(-1, 6)
    # The smallest solution: without turning, earth field and bias cannot be told apart, nor need they be.
    fitted = np.linalg.pinv(rows.T @ rows, rcond=1e-9) @ (rows.T @ observation[usable].ravel())
    return observation - design @ fitted
