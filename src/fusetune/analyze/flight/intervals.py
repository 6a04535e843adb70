"""Intervals of time, half-open, µs, and what is cut out of them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.finding import Finding

Interval = tuple[int, int]
NOT_SCORED = "not_scored"


@dataclass(frozen=True)
class Cut:
    """A part of the flight that is not scored, µs, and why."""

    start: int
    stop: int
    reason: str

    @property
    def finding(self) -> Finding:
        """The cut in the form that all rooms share, for it to be told."""
        seconds = (self.stop - self.start) * 1e-6
        return Finding(
            NOT_SCORED, "note", self.reason, figure=seconds, unit="s", start_us=self.start, stop_us=self.stop
        )


def stretches(flags: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and one past the last index of each stretch in which flags (N,) are true."""
    edges = np.flatnonzero(np.diff(np.r_[False, flags, False].astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def inside(time: npt.NDArray[np.int64], intervals: Iterable[Interval]) -> npt.NDArray[np.bool_]:
    """True for the times (N,), µs, that lie in one of the intervals."""
    found = np.zeros(time.shape, dtype=bool)
    for start, stop in intervals:
        found |= (time >= start) & (time < stop)
    return found


def subtract(intervals: Sequence[Interval], cuts: Iterable[Cut]) -> tuple[Interval, ...]:
    """Remove cuts from intervals; all half-open, µs."""
    remaining = [interval for interval in intervals if interval[1] > interval[0]]
    for cut in cuts:
        pieces: list[Interval] = []
        for start, stop in remaining:
            if cut.stop <= start or cut.start >= stop:
                pieces.append((start, stop))
                continue
            if start < cut.start:
                pieces.append((start, cut.start))
            if cut.stop < stop:
                pieces.append((cut.stop, stop))
        remaining = pieces
    return tuple(sorted(remaining))


def duration(intervals: Sequence[Interval]) -> int:
    """Length of intervals together, µs."""
    return sum(stop - start for start, stop in intervals)


def merged(cuts: list[Cut]) -> tuple[Cut, ...]:
    """Cuts that touch or overlap as one, with the reasons of all."""
    found: list[Cut] = []
    for cut in sorted(cuts, key=lambda cut: (cut.start, cut.stop, cut.reason)):
        if found and cut.start <= found[-1].stop:
            last = found[-1]
            reasons = sorted({*last.reason.split(", "), cut.reason})
            found[-1] = Cut(last.start, max(last.stop, cut.stop), ", ".join(reasons))
        else:
            found.append(cut)
    return tuple(found)
