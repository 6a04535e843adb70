"""Which message of a topic the estimator sees at each of its runs.

The estimator runs once per IMU sample and takes, of every topic, the newest message published since its last run.
Where the log holds `ekf2_timestamps`, that topic says what had arrived at each run on the vehicle (the same way
PX4's own replay reads it); otherwise every message counts as arrived at its time stamp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusetune.px4.estimator_samples import RELATIVE_FIELDS, RELATIVE_TICK_US, RELATIVE_TIMESTAMP_INVALID
from fusetune.px4.flight import Flight, TopicTable

TRUNCATION_SLACK_US = 99
"""`ekf2_timestamps` stores differences of times cut to 0.1 ms, so a message may be this much later than it says."""


@dataclass(frozen=True)
class RunSchedule:
    """The estimator's runs over one flight."""

    mode: str
    """``"timestamps"`` where `ekf2_timestamps` gave the order, ``"approx"`` for time order."""
    imu_rows: np.ndarray
    """(N,) row of `sensor_combined` that each run processes."""
    timestamp: np.ndarray
    """(N,) int64 µs, time stamp of that row."""
    _passes: np.ndarray
    """(M,) int64 µs, times at which messages are let through; at least one per run."""
    _pass_of_run: np.ndarray
    """(N,) last pass at or before each run."""
    _ekf2_timestamps: TopicTable | None

    def newest_message(self, topic: str, message_timestamps: np.ndarray) -> np.ndarray:
        """Index of the message of `topic` that is new at each run, -1 where none is; shape (N,).

        Messages count as published in the order of the log; one that is stamped later holds up those behind it.
        """
        arrival = np.maximum.accumulate(np.asarray(message_timestamps, dtype=np.int64))
        seen = np.searchsorted(arrival, self._limits(topic), side="right")[self._pass_of_run]
        before = np.concatenate([[0], seen[:-1]])
        return np.where(seen > before, seen - 1, -1)

    def _limits(self, topic: str) -> np.ndarray:
        """Latest time stamp of `topic` let through at each pass (µs, never falling)."""
        field = RELATIVE_FIELDS.get(topic)
        if self._ekf2_timestamps is None or field not in self._ekf2_timestamps:
            return np.maximum.accumulate(self._passes)
        relative = self._ekf2_timestamps[field].astype(np.int64)
        limit = self._passes + relative * RELATIVE_TICK_US + TRUNCATION_SLACK_US
        return np.maximum.accumulate(np.where(relative == RELATIVE_TIMESTAMP_INVALID, np.int64(0), limit))


def schedule_runs(flight: Flight) -> RunSchedule:
    """Find the runs of the estimator in a log.

    Parameters
    ----------
    flight : Flight
        Canonical flight with `sensor_combined`, and `ekf2_timestamps` where logged.

    Raises
    ------
    KeyError
        The flight has no `sensor_combined`.
    """
    imu_timestamp = flight.topics["sensor_combined", 0]["timestamp"].astype(np.int64)
    logged = flight.topic("ekf2_timestamps")
    if logged is None or len(logged["timestamp"]) == 0:
        rows = np.arange(len(imu_timestamp))
        return RunSchedule("approx", rows, imu_timestamp, imu_timestamp, rows, None)
    passes = logged["timestamp"].astype(np.int64)
    order = np.argsort(imu_timestamp, kind="stable")
    position = np.minimum(np.searchsorted(imu_timestamp[order], passes), len(order) - 1)
    rows = order[position]
    matched = np.flatnonzero(imu_timestamp[rows] == passes)
    return RunSchedule("timestamps", rows[matched], passes[matched], passes, matched, logged)
