"""Magnetometer samples between those that a thinned log holds.

The field hardly changes over the ground, the attitude does: between two samples it is the field in the earth frame
that is smoothed and interpolated. What turns with the vehicle (hard iron that the calibration left) is taken off before
and put back after, as the field at rest in the body is no part of the earth's.
"""

from __future__ import annotations

import numpy as np

from fusetune.analyze.reconstruction.attitude import AttitudeHistory
from fusetune.analyze.reconstruction.between_samples import NewRows, interpolate, share_of_way
from fusetune.analyze.reconstruction.magnetic_field import magnetic_field
from fusetune.px4.flight import TopicTable, stacked

MIN_SPLINE_SAMPLES = 16


def interpolate_magnetometer(
    table: TopicTable, attitude: AttitudeHistory, rate_hz: float, max_bridge_s: float
) -> tuple[TopicTable, np.ndarray]:
    """Interpolate `vehicle_magnetometer` to a higher rate; all else as of `interpolate`.

    Parameters
    ----------
    table : canonical `vehicle_magnetometer` of one device
    attitude : of the vehicle, in a frame that hardly moves (`steady_history`)
    """

    def where_the_attitude_is_known(sampled: np.ndarray, time: np.ndarray, place: np.ndarray) -> NewRows:
        measured = stacked(table, "magnetometer_ga")
        q, known = attitude.at(sampled)
        q_new, known_new = attitude.at(time)
        usable = known_new & known[place - 1] & known[place]
        time, place, q_new = time[usable], place[usable], q_new[usable]
        field = magnetic_field(sampled[known], q[known], measured[known])
        earth = np.zeros_like(measured)
        earth[known] = field.earth
        between = field.seen(_between(sampled, earth, known, time, place), q_new)
        return time, place, {f"magnetometer_ga[{axis}]": between[:, axis] for axis in range(3)}

    return interpolate(table, rate_hz, max_bridge_s, where_the_attitude_is_known)


def _between(
    sampled: np.ndarray, earth: np.ndarray, known: np.ndarray, time: np.ndarray, place: np.ndarray
) -> np.ndarray:
    """Field (M, 3) at `time`: on the line between its neighbours, or on a spline where that foretells samples better.

    A spline is for a smooth field that its samples show without noise; a random walk between samples is on the line.
    """
    if _spline_is_nearer(earth[known]):
        # Imported here: it takes a fifth of a second to load, and few logs need it.
        from scipy.interpolate import CubicSpline

        return np.asarray(CubicSpline(sampled[known] * 1e-6, earth[known])(time * 1e-6))
    share = share_of_way(sampled, time, place)[:, None]
    return earth[place - 1] + share * (earth[place] - earth[place - 1])


def _spline_is_nearer(earth: np.ndarray) -> bool:
    """Leave each sample out: is it nearer to the cubic through the two samples on each side, or to the line?"""
    if len(earth) < MIN_SPLINE_SAMPLES:
        return False
    near, far, here = earth[1:-3] + earth[3:-1], earth[:-4] + earth[4:], earth[2:-2]
    # Lagrange's weights at 0 of the points -2, -1, 1, 2
    cubic, line = (4.0 * near - far) / 6.0, 0.5 * near
    return bool(np.sum((cubic - here) ** 2) < np.sum((line - here) ** 2))
