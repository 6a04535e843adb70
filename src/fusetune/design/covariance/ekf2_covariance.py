"""EKF2's own covariance recursion along a track, told just before corrections, and at the time of flight.

Nothing of the filter stands here: it runs as it does in a replay, on a flight without errors (`perfect_flight`). Where
P is wanted as it is just before a correction, a copy of the filter goes on by one update to which no sample comes; the
same copy going on until its horizon is the present gives P of what the vehicle is told now.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.ekf2.feed.inputs import EstimatorInputs, build_inputs
from fusetune.ekf2.replay.course import Course
from fusetune.ekf2.replay.recording import RecordArrays
from fusetune.ekf2.replay.replay import begin_course, replay
from fusetune.ekf2.replay.results import ReplayResult
from fusetune.px4.aid_sources import AID_SOURCES, RECORDED_SOURCES
from fusetune.px4.flight import Flight

Array = npt.NDArray[np.float64]

MOST_INSTANTS = 48
"""Of the corrections in the window as many are looked at, evenly spread over them."""
_IS_MEASURED = np.array([bool(AID_SOURCES[name].sensor) for name in RECORDED_SOURCES])
"""Of each source of the replay, by its code, whether it is a sensor's."""
WITHOUT_AIDING_US = 200_000
"""Every so often where nothing is fused."""


@dataclass(frozen=True)
class CovarianceAlong:
    """P at K corrections.

    Attributes
    ----------
    horizon_us : (K,) of the state that is corrected
    before : (K, 24, 24) covariance of the error state just before
    now : (K, 24, 24) the same of the state at the time of flight
    source : aid source before whose corrections it is
    rejected : share of the sensors' measurements in the window that the filter refused
    wind, field : whether it estimates the wind and the magnetic field in the window
    """

    horizon_us: npt.NDArray[np.int64]
    before: Array
    now: Array
    source: str
    rejected: float
    wind: bool
    field: bool


def covariance_along(flight: Flight, parameters: Mapping[str, float], window_us: tuple[int, int]) -> CovarianceAlong:
    """Run EKF2 over a flight and tell its covariances in a window of time.

    Parameters
    ----------
    flight : in the layout of v1.16
    parameters : a complete set
    window_us : from and to, of the horizon

    Raises
    ------
    ValueError
        The filter does not run in that window.
    """
    inputs = build_inputs(flight)
    result = replay(inputs, parameters, keep=_without_position)
    updates, source = _corrections(result, window_us)
    imu_us = inputs.arrays.imu["time_us"]
    runs = np.searchsorted(imu_us, result.states["timestamp"][updates])
    course, first, _ = begin_course(inputs, parameters)
    before, now = [], []
    estimated: set[str] = set()
    wanted = set(runs.tolist())
    for begin, end in course.stretches(first, int(runs[-1]) + 1, runs.tolist()):
        if begin in wanted:
            at, later = _uncorrected(course, inputs, begin)
            before.append(at)
            now.append(later)
            estimated |= {name for name in ("wind", "mag") if course.ekf["cs"][name][0]}
        course.advance(begin, end)
    measured = _inside(result.innovations["timestamp_sample"], window_us) & _IS_MEASURED[result.innovations["source"]]
    rejected = float(result.innovations["innovation_rejected"][measured].mean()) if measured.any() else 0.0
    horizon = result.states["timestamp_sample"][updates].astype(np.int64)
    return CovarianceAlong(
        horizon, np.array(before), np.array(now), source, rejected, "wind" in estimated, "mag" in estimated
    )


def _without_position(rows: RecordArrays) -> RecordArrays:
    return rows._replace(local_position=rows.local_position[:0])


def _inside(times: np.ndarray, window_us: tuple[int, int]) -> np.ndarray:
    return np.asarray((times >= window_us[0]) & (times < window_us[1]))


def _corrections(result: ReplayResult, window_us: tuple[int, int]) -> tuple[np.ndarray, str]:
    """Updates that correct by the rarest of the sources that are fused in the window, and its name."""
    horizon = result.states["timestamp_sample"]
    inside = np.flatnonzero(_inside(horizon, window_us))
    if len(inside) < 2:
        raise ValueError("the filter does not run in the window")
    rows = result.innovations[result.innovations["fused"] & _inside(result.innovations["timestamp_sample"], window_us)]
    measured = {
        RECORDED_SOURCES[code]: np.unique(rows["timestamp_sample"][rows["source"] == code])
        for code in np.unique(rows["source"])
        if _IS_MEASURED[code]
    }
    if not measured:
        every = np.flatnonzero(np.diff(horizon[inside] // WITHOUT_AIDING_US) > 0)
        return _thinned(inside[every + 1]), ""
    # one that was fused only now and then has stopped; the rarest that goes on counts
    source = min(measured, key=lambda name: (len(measured[name]) < 2, len(measured[name])))
    updates = np.searchsorted(horizon, measured[source])
    return _thinned(np.unique(updates[(updates > inside[0]) & (updates <= inside[-1])])), source


def _thinned(updates: np.ndarray) -> np.ndarray:
    chosen = np.unique(np.linspace(0, len(updates) - 1, min(MOST_INSTANTS, len(updates))).round().astype(int))
    return np.asarray(updates[chosen])


def _uncorrected(course: Course, inputs: EstimatorInputs, run: int) -> tuple[Array, Array]:
    """P after one update without measurements, and when the horizon has come to the present, each (24, 24)."""
    alone = course.without_samples()
    alone.advance(run, run + 1)
    before = alone.ekf["P"][0].copy()
    alone.reach(run + 1, int(inputs.arrays.imu["time_us"][run]))
    return before, alone.ekf["P"][0].copy()
