"""The raw topics of a real log, for calculations by hand: read by pyulog, none of it by the project."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pyulog import ULog

Columns = dict[str, np.ndarray]


class RawLog:
    """Topics as pyulog has them, and the times in the air as PX4's `ecl_ekf` scripts take them."""

    def __init__(self, path: Path) -> None:
        self.log = ULog(str(path))
        land = self.topic("vehicle_land_detected")
        edges = np.flatnonzero(np.diff(np.r_[1, land["landed"], 1].astype(int)))
        times = np.r_[land["timestamp"], self.log.last_timestamp].astype(np.int64)
        self.flights = [(times[a], times[b]) for a, b in zip(edges[::2], edges[1::2], strict=True)]

    def topic(self, name: str, instance: int = 0) -> Columns:
        """Columns of a topic."""
        return self.log.get_dataset(name, instance).data

    def flying(self, time: np.ndarray, margin_s: float = 0.0) -> np.ndarray:
        """Rows in the air, but for a margin after take-off and before landing; what is left of 5 s at least."""
        margin = int(margin_s * 1e6)
        found = np.zeros(len(time), bool)
        for start, stop in self.flights:
            if stop - start - 2 * margin >= 5_000_000:
                found |= (time >= start + margin) & (time < stop - margin)
        return found

    def in_flight(self, topic: str, field: str, instance: int = 0, margin_s: float = 0.0) -> np.ndarray:
        """A field in the air."""
        table = self.topic(topic, instance)
        return table[field][self.flying(table["timestamp"], margin_s)].astype(np.float64)

    def share_of_time(self, topic: str, field: str, instance: int = 0, margin_s: float = 0.0) -> float:
        """Share of the flights in which a flag was set, each row holding to the next; in steps of a millisecond."""
        table, margin = self.topic(topic, instance), int(margin_s * 1e6)
        set_, whole = 0, 0
        for start, stop in self.flights:
            if stop - start - 2 * margin < 5_000_000:
                continue
            ticks = np.arange(start + margin, stop - margin, 1000)
            row = np.searchsorted(table["timestamp"], ticks, side="right") - 1
            set_ += int(np.sum((row >= 0) & (table[field][np.maximum(row, 0)] > 0)))
            whole += len(ticks)
        return set_ / whole
