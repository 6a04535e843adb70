"""A flight in pieces that are of one manoeuvre class and, where it flew a mission, of one leg."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.manoeuvre_classes import GROUND

NO_LEG = -1


@dataclass(frozen=True)
class FlightPieces:
    """Pieces of a flight in the air, in order of time.

    Attributes
    ----------
    mission : that was flown; empty where it was none of those that it was compared with
    start, stop : (P,) µs since boot; half-open
    kind : (P,) manoeuvre class
    leg : (P,) leg of the mission, counted from 0; `NO_LEG` beside all legs
    """

    mission: str
    start: npt.NDArray[np.int64]
    stop: npt.NDArray[np.int64]
    kind: tuple[str, ...]
    leg: npt.NDArray[np.int64]

    def at(self, time: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """(N,) piece of each time, µs; −1 on the ground and where the log has gaps."""
        if not self.start.size:
            return np.full(time.shape, -1)
        row = np.searchsorted(self.start, time, side="right") - 1
        inside = (row >= 0) & (time < self.stop[np.maximum(row, 0)])
        return np.asarray(np.where(inside, row, -1))

    def at_ascending(self, time: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """The same of times (N,) that ascend, again and again: as fast as few of their stretches are."""
        begins = np.flatnonzero(np.r_[True, time[1:] < time[:-1]][: time.size])
        if not time.size or not self.start.size or self.start.size * begins.size > time.size:
            return self.at(time)
        # a row belongs to a piece from the first at or after its start to the last before its stop
        edges = np.column_stack([self.start, self.stop]).ravel()
        ends = [*begins[1:].tolist(), time.size]
        changes = np.concatenate(
            [
                first + np.append(np.searchsorted(time[first:last], edges), last - first)
                for first, last in zip(begins.tolist(), ends, strict=True)
            ]
        )
        of_change = np.full(edges.size + 1, -1)
        of_change[1::2] = np.arange(self.start.size)
        return np.repeat(np.tile(of_change, begins.size), np.diff(changes, prepend=0))


def flight_pieces(document: Mapping[str, Any]) -> FlightPieces:
    """Pieces of a flight, from its `conformance.json`."""
    flown = next((one for one in document["missions"] if one["mission"] == document["flown"]), None)
    legs = [one for one in flown["legs"] if one["start_us"] is not None] if flown is not None else []
    rows = [
        (start, stop, one["kind"], leg)
        for one in document["manoeuvres"]
        if one["kind"] != GROUND
        for start, stop, leg in _cut(one["start_us"], one["stop_us"], legs)
    ]
    start, stop, kind, leg = zip(*rows, strict=True) if rows else ((), (), (), ())
    return FlightPieces(
        flown["mission"] if flown is not None else "",
        np.array(start, np.int64),
        np.array(stop, np.int64),
        tuple(kind),
        np.array(leg, np.int64),
    )


def _cut(start: int, stop: int, legs: list[Mapping[str, Any]]) -> list[tuple[int, int, int]]:
    """A stretch cut where legs begin and end."""
    ends = {edge for leg in legs for edge in (leg["start_us"], leg["stop_us"]) if start < edge < stop}
    found = []
    for first, last in pairwise(sorted({start, stop, *ends})):
        leg = next((one["leg"] for one in legs if one["start_us"] <= first and last <= one["stop_us"]), NO_LEG)
        found.append((first, last, leg))
    return found
