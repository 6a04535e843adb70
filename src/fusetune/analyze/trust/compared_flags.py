"""Status flags of a replay beside those of the vehicle."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.flight.intervals import Interval
from fusetune.ekf2.replay.recording import FLAG_COLUMNS
from fusetune.ekf2.replay.results import ReplayResult
from fusetune.px4.aid_sources import MEASURED_SOURCES
from fusetune.px4.flight import Flight, row_count
from fusetune.px4.layouts.estimator_instances import rows_of_primary

COMPARED_FLAGS = (
    "cs_tilt_align", "cs_yaw_align", "cs_gnss_pos", "cs_baro_hgt", "cs_ev_pos", "cs_opt_flow", "cs_in_air",
    "fs_bad_acc_vertical",
)  # fmt: skip
"""Flags that mean the same in all releases."""

HEIGHT_FLAGS = tuple(
    flag for source in MEASURED_SOURCES.values() if source.quantity == "height" for flag in source.flags
)
"""What the height is taken from."""


class FlagPairs:
    """Status flags of the vehicle beside those of a replay, ten times a second."""

    STEP_US = 100_000

    def __init__(self, result: ReplayResult, flight: Flight, intervals: tuple[Interval, ...]) -> None:
        self.table = rows_of_primary(flight, "estimator_status_flags")
        self.flags = result.flags
        steps = [np.arange(start, stop, self.STEP_US) for start, stop in intervals]
        self.times = np.concatenate([np.zeros(0, np.int64), *steps])

    def vehicle(self, name: str, times: np.ndarray) -> np.ndarray | None:
        """A flag of the vehicle as last logged before each time."""
        if self.table is None or name not in self.table or not row_count(self.table):
            return None
        rows = np.searchsorted(self.table["timestamp"].astype(np.int64), times, side="right") - 1
        return np.asarray(self.table[name][np.maximum(rows, 0)].astype(bool))

    def mean_share_equal(self, names: tuple[str, ...]) -> float | None:
        """Share of the time in which a flag agrees, mean over the flags."""
        shares = [float(np.mean(ours == theirs)) for ours, theirs in self._pairs(names)]
        return float(np.mean(shares)) if shares else None

    def share_all_equal(self, names: tuple[str, ...], *, beside: bool) -> float | None:
        """Share of the time in which all flags agree; with `beside` the replay may have others set, too."""
        pairs = self._pairs(names)
        if not pairs or not any(theirs.any() for _, theirs in pairs):
            return None
        agree = [(ours == theirs) | (ours & beside) for ours, theirs in pairs]
        return float(np.mean(np.all(agree, axis=0)))

    def _pairs(self, names: tuple[str, ...]) -> list[tuple[np.ndarray, np.ndarray]]:
        if not len(self.flags) or not len(self.times):
            return []
        rows = np.maximum(np.searchsorted(self.flags["timestamp"], self.times, side="right") - 1, 0)
        pairs = []
        for name in names:
            theirs = self.vehicle(name, self.times)
            if theirs is not None:
                pairs.append((self.flags["flags"][rows, FLAG_COLUMNS.index(name)].astype(bool), theirs))
        return pairs
