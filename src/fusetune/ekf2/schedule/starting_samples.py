"""Samples by which v1.13 starts: it looks for one of magnetometer and barometer at every run until it has enough.

Mirrors `initialiseFilter` of PX4 v1.13 `EKF/ekf.cpp`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fusetune.ekf2.schedule.sensor_actions import DUE
from fusetune.ekf2.schedule.updates import INITIAL_INTERVAL_S, UPDATE

Rows = np.ndarray[Any, np.dtype[Any]]

LPF_ALPHA = 0.1


class StartingSamples(NamedTuple):
    """Of a sensor, the runs at which samples are taken before the start, and their positions, in order."""

    runs: Rows
    slots: Rows
    times_us: Rows

    def until(self, run: int) -> int:
        """How many are taken until a run, that included."""
        return int(np.searchsorted(self.runs, run, side="right"))

    def run_of(self, count: int) -> int | None:
        """The run at which there are so many; None for never."""
        return int(self.runs[count - 1]) if 0 < count <= len(self.runs) else None


def looks_of_runs(intervals: Rows, runs: int, imu_length: int) -> Rows:
    """UPDATE for every run from the first interval on, as the filter looks for samples until it has started."""
    first = int(intervals["run"][0]) if len(intervals) else runs
    looks = np.zeros(runs - first, UPDATE)
    looks["run"] = np.arange(first, runs)
    newest = np.searchsorted(intervals["run"], looks["run"], side="right") - 1
    looks["delayed"] = np.maximum(newest - imu_length + 1, 0)
    looks["average_dt"] = INITIAL_INTERVAL_S
    return looks


def taken_at(looks: Rows, actions: Rows) -> StartingSamples:
    """What is taken, of the actions that a schedule has for these looks."""
    due = actions[actions["what"] == DUE]
    return StartingSamples(looks["run"][due["update"]].astype(np.int64), due["slot"], due["time_us"])


def low_passed(samples: Rows) -> Rows:
    """The last value of a filter that starts with the first sample, (N, …) → (…)."""
    value = samples[0].astype(float)
    for sample in samples[1:]:
        value = value + LPF_ALPHA * (sample - value)
    return value
