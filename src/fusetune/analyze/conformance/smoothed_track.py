"""The track of a flight by what the whole of it says of each moment, instead of what was known at the time.

The smoothed velocity (`fusetune.analyze.smoothing`) is integrated and laid on the receiver's positions, by their mean
over the minute before and after. So the track has none of the lag and noise of the vehicle's estimate; the error that a
receiver keeps over minutes it has as well, for nothing on board tells that.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from fusetune.analyze.conformance.flown_track import FlownTrack, parts_of
from fusetune.analyze.metrics.attitude import interpolate, interpolate_quaternion
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.analyze.smoothing.smoothed_velocity import LONGEST_STRETCH_S, SmoothedVelocity, smoothed_velocity
from fusetune.px4.flight import select_rows
from fusetune.px4.local_map import LocalMap
from fusetune.quaternions import rotation_matrix

Array = npt.NDArray[np.float64]

_STEP_US = 50_000
_SHORTEST_US = 20_000_000
"""Of a shorter part of the flight the mean of the receiver's positions is no better than the vehicle's estimate."""
_FIX_3D = 3


def smoothed_track(observed: ObservedFlight, track: FlownTrack) -> FlownTrack:
    """The track with smoothed places; the track itself where the flight has no GNSS velocities and positions.

    Parameters
    ----------
    observed : can be replayed
    track : of this flight, by the vehicle's own estimate
    """
    if track.source != "estimate" or observed.replayed.status != "ok":
        return track
    velocity = smoothed_velocity(observed.replayed, observed.flight, observed.airborne, _STEP_US)
    if velocity is None:
        return track
    local = LocalMap(float(track.lat[0]), float(track.lon[0]))
    received = _received(observed, local)
    if received is None:
        return track
    places = track.about(local.lat_deg, local.lon_deg, 0.0)[:, :2]
    found = places.copy()
    for part in parts_of(velocity.time):
        if velocity.time[part][-1] - velocity.time[part][0] >= _SHORTEST_US:
            _lay(found, places, track.time, _way(velocity, part), *received)
    lat, lon = np.array([local.to_global(*place) for place in found.tolist()]).T
    return replace(track, source="smoothed", lat=lat, lon=lon)


def _received(observed: ObservedFlight, local: LocalMap) -> tuple[npt.NDArray[np.int64], Array] | None:
    """Times (M,) and places (M, 2) of the IMU by the receiver."""
    table = observed.flight.topic("vehicle_gps_position")
    if table is None or not {"latitude_deg", "longitude_deg", "fix_type"} <= set(table):
        return None
    rows = select_rows(table, table["fix_type"] >= _FIX_3D)
    states, parameters = observed.replayed.states(), observed.parameters
    time = rows["timestamp"].astype(np.int64) - round(parameters["EKF2_GPS_DELAY"] * 1e3)
    known = (time >= states.time[0]) & (time <= states.time[-1])
    if not known.any():
        return None
    columns = (rows[name][known].tolist() for name in ("latitude_deg", "longitude_deg"))
    antenna = np.array([local.to_local(lat, lon) for lat, lon in zip(*columns, strict=True)])
    arm = [parameters[f"EKF2_GPS_POS_{axis}"] - parameters[f"EKF2_IMU_POS_{axis}"] for axis in "XYZ"]
    turn = rotation_matrix(interpolate_quaternion(states.time, states.quaternion, time[known]))
    return time[known], antenna - (turn @ np.array(arm))[:, :2]


def _way(velocity: SmoothedVelocity, part: slice) -> tuple[npt.NDArray[np.int64], Array]:
    """Times and integral of the velocity in a part of the flight, (K, 2) north and east, m."""
    time, flat = velocity.time[part], velocity.velocity[part, :2]
    step_s = np.diff(time)[:, None] * 1e-6
    return time, np.vstack([np.zeros(2), np.cumsum(0.5 * (flat[1:] + flat[:-1]) * step_s, axis=0)])


def _lay(
    found: Array,
    places: Array,
    time: npt.NDArray[np.int64],
    way: tuple[npt.NDArray[np.int64], Array],
    received_time: npt.NDArray[np.int64],
    received: Array,
) -> None:
    """Put the way of a part of the flight in its places; what lies beside the part moves with its ends."""
    begin, end = way[0][0], way[0][-1]
    taken = (received_time >= begin) & (received_time <= end)
    rows = np.flatnonzero((time >= begin) & (time <= end))
    if np.count_nonzero(taken) < 2 or not rows.size:
        return
    known = received_time[taken]
    lies = _around(known, received[taken] - interpolate(way[0], way[1], known))
    found[rows] = interpolate(way[0], way[1], time[rows]) + interpolate(known, lies, time[rows])
    found[: rows[0]] = places[: rows[0]] + (found[rows[0]] - places[rows[0]])
    found[rows[-1] + 1 :] = places[rows[-1] + 1 :] + (found[rows[-1]] - places[rows[-1]])


def _around(time: npt.NDArray[np.int64], values: Array) -> Array:
    """Means (M, 2) over half a stretch of the smoother before and after each time; fewer at the ends."""
    half = round(0.5e6 * LONGEST_STRETCH_S)
    sums = np.vstack([np.zeros(2), np.cumsum(values, axis=0)])
    first, stop = np.searchsorted(time, time - half), np.searchsorted(time, time + half, side="right")
    return np.asarray((sums[stop] - sums[first]) / (stop - first)[:, None])
