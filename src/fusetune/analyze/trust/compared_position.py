"""`vehicle_local_position` of a replay beside that of the vehicle."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.trust.compared_flags import FlagPairs
from fusetune.analyze.trust.compared_innovations import MIN_SAMPLES, wrapped
from fusetune.ekf2.replay.results import ReplayResult
from fusetune.px4.flight import Flight, TopicTable
from fusetune.px4.layouts.estimator_instances import instance_switches

HEIGHT_RESETS = {"z_reset_counter": "height", "vz_reset_counter": "vertical velocity"}
"""Counter of `vehicle_local_position` → what was reset."""

SWITCH_US = 1_000_000
"""Resets this soon after another estimator instance became primary are the selector's, which a replay has not."""

COMPARED_FIELDS = ("timestamp", "vx", "vy", "vz", "z", "heading", *HEIGHT_RESETS)


class LocalPositions:
    """`vehicle_local_position` of the vehicle beside that of a replay."""

    def __init__(self, result: ReplayResult, flight: Flight, intervals: tuple[Interval, ...]) -> None:
        self.flight, self.intervals = flight, intervals
        self.ours = result.local_position
        table = flight.topic("vehicle_local_position")
        self.theirs: TopicTable = table if table is not None and len(self.ours) >= 2 else {"timestamp": np.zeros(0)}
        self.time = self.theirs.get("timestamp_sample", self.theirs["timestamp"]).astype(np.int64)
        self.shared = inside(self.time, intervals)
        if len(self.time):
            self.shared &= (self.time >= self.ours["timestamp"][0]) & (self.time <= self.ours["timestamp"][-1])

    def horizontal_velocity(self) -> float | None:
        usable = self._usable("v_xy_valid", "xy_valid", needs=("vx", "vy"))
        if usable is None:
            return None
        squares = self._difference("vx", usable) ** 2 + self._difference("vy", usable) ** 2
        return float(np.sqrt(np.mean(squares)))

    def height(self) -> float | None:
        usable = self._usable("z_valid", needs=("z",))
        return None if usable is None else float(np.std(self._difference("z", usable)))

    def vertical_velocity(self) -> float | None:
        usable = self._usable("v_z_valid", needs=("vz",))
        return None if usable is None else float(np.sqrt(np.mean(self._difference("vz", usable) ** 2)))

    def heading(self, flags: FlagPairs) -> float | None:
        """RMS difference of heading, degrees, while the vehicle's is aligned: before, it is any."""
        name = next((name for name in ("heading", "yaw") if name in self.theirs), None)
        usable = None if name is None else self._usable(needs=(name,))
        if usable is None or name is None:
            return None
        aligned = flags.vehicle("cs_yaw_align", self.time)
        usable &= self._flag("xy_valid") if aligned is None else aligned
        if usable.sum() < MIN_SAMPLES:
            return None
        at = np.clip(np.searchsorted(self.ours["timestamp"], self.time[usable]), 0, len(self.ours) - 1)
        difference = wrapped(self.ours["heading"][at] - self.theirs[name][usable].astype(np.float64))
        return float(np.degrees(np.sqrt(np.mean(difference**2))))

    def resets(self) -> dict[str, tuple[int, int]]:
        """Resets of the replay and of the vehicle in the compared parts, but those that follow a change of instance."""
        found = {}
        for counter, words in HEIGHT_RESETS.items():
            if counter in self.theirs and self.shared.sum() >= MIN_SAMPLES:
                theirs = _increments(self.theirs[counter], modulo=256)
                ours = _increments(self.ours[counter])
                found[words] = (self._counted(self.ours["timestamp"], ours), self._counted(self.time, theirs))
        return found

    def _counted(self, time: np.ndarray, increments: np.ndarray) -> int:
        since = np.full(len(time), 2**62)
        for switch in instance_switches(self.flight):
            since = np.where(time >= switch, np.minimum(since, time - switch), since)
        return int(increments[inside(time, self.intervals) & (since > SWITCH_US)].sum())

    def _flag(self, name: str) -> np.ndarray:
        return self.theirs[name].astype(bool) if name in self.theirs else np.ones(len(self.time), np.bool_)

    def _usable(self, *flags: str, needs: tuple[str, ...]) -> np.ndarray | None:
        """Rows that are compared and that the vehicle called valid; None where there are too few."""
        if any(name not in self.theirs for name in needs):
            return None
        usable = self.shared.copy()
        for name in flags:
            usable &= self._flag(name)
        for name in needs:
            usable &= np.isfinite(self.theirs[name].astype(np.float64))
        return usable if usable.sum() >= MIN_SAMPLES else None

    def _difference(self, name: str, usable: np.ndarray) -> np.ndarray:
        ours = np.interp(self.time[usable], self.ours["timestamp"], self.ours[name])
        return np.asarray(ours - self.theirs[name][usable].astype(np.float64))


def _increments(counter: np.ndarray, modulo: int = 2**31) -> np.ndarray:
    """Increments of a counter that wraps around, at the row that shows them."""
    count = counter.astype(np.int64)
    return np.mod(np.diff(count, prepend=count[:1]), modulo)
