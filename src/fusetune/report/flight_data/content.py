"""What is shown of a flight, before it is thinned: panels with their series, bands, marks, events and the track."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

Times = npt.NDArray[np.int64]
Figures = npt.NDArray[Any]
Kind = Literal["innovation", "ratio", "line", "band"]
Draw = Literal["line", "points", "step"]
Role = Literal["present", "chosen", "candidate", "ruled_out", "onboard", "as_flown"]

_LONG_GAP = 6.0
"""In sample spacings: between samples further apart nothing is drawn."""
_SHORTEST_GAP_US = 1_000_000


class ShownSet(NamedTuple):
    """A parameter set, or the vehicle's own filter, and how it looks."""

    name: str
    role: Role
    style: int
    marker: str


@dataclass(frozen=True)
class Series:
    """A curve.

    Attributes
    ----------
    label : for people; of a set its name
    time : (N,) µs since boot, ascending
    values : (N,)
    set : whose it is; None of a sensor and the like
    sigma : (N,) standard deviation
    gate : the filter rejects what lies beyond so many of them; None where there is no gate
    rejected : (N,) what the filter rejected
    peaks : (N,) whose largest values are kept, too, when it is thinned
    samples, rejected_samples : how many there are, and how many of them were rejected, before it is thinned
    """

    label: str
    time: Times
    values: Figures
    set: str | None = None
    sigma: Figures | None = None
    gate: float | None = None
    rejected: npt.NDArray[np.bool_] | None = None
    draw: Draw = "line"
    peaks: Figures | None = None
    samples: int = 0
    rejected_samples: int | None = None

    def rows(self, chosen: slice | npt.NDArray[Any]) -> Series:
        """Some of its samples."""
        columns = ("time", "values", "sigma", "rejected", "peaks")
        kept = {name: getattr(self, name) for name in columns}
        return replace(self, **{name: values[chosen] for name, values in kept.items() if values is not None})


@dataclass(frozen=True)
class Panel:
    """Curves that share their axes."""

    id: str
    group: str
    title: str
    unit: str
    series: tuple[Series, ...]
    kind: Kind = "line"
    source: str | None = None
    axis: int | None = None
    log: bool = False
    limit: float | None = None


class Span(NamedTuple):
    """A part of the flight, µs since boot, and what is said of it."""

    start: int
    stop: int
    words: str = ""


@dataclass(frozen=True)
class Band:
    """When something was so."""

    id: str
    label: str
    spans: tuple[Span, ...]


@dataclass(frozen=True)
class Mark:
    """A finding, and when it holds, s since the log began."""

    id: str
    severity: str
    title: str
    since_s: float
    until_s: float


class Event(NamedTuple):
    """Something that happened at a time, µs since boot."""

    time: int
    kind: str
    title: str


@dataclass(frozen=True)
class PlaneTrack:
    """Where the vehicle was, m north, east and above of a place; heading rad; (N,) each."""

    time: Times
    north: Figures
    east: Figures
    height: Figures
    heading: Figures


@dataclass(frozen=True)
class TrackView:
    """The track with what it is compared with.

    Attributes
    ----------
    flown : what the vehicle, or the replay, says of it
    gnss : fixes of the receiver
    sets : replays by the name of their set
    mission : north and east of its corners, m; empty where none was flown
    manoeuvres : what was flown when
    """

    flown: PlaneTrack
    gnss: PlaneTrack | None = None
    sets: Mapping[str, PlaneTrack] = field(default_factory=dict)
    mission: tuple[tuple[float, float], ...] = ()
    manoeuvres: tuple[Span, ...] = ()


@dataclass(frozen=True)
class FlightContent:
    """All that is shown of a flight.

    Attributes
    ----------
    start_us : when its log begins, µs since boot
    takeoff_s, landing_s : since then; None where the log does not tell
    """

    flight: str
    label: str
    start_us: int
    duration_s: float
    takeoff_s: float | None
    landing_s: float | None
    sets: tuple[ShownSet, ...]
    panels: tuple[Panel, ...]
    bands: tuple[Band, ...]
    marks: tuple[Mark, ...]
    events: tuple[Event, ...]
    track: TrackView | None


def with_gaps(time: Times, columns: Iterable[Figures]) -> tuple[Times, list[Figures]]:
    """Times and columns in the order of time, with a row of NaN behind each sample after which there is long none."""
    steps = np.diff(time)
    given = list(columns)
    if steps.size and steps.min() < 0:
        order = np.argsort(time, kind="stable")
        time, given = time[order], [one[order] for one in given]
        steps = np.diff(time)
    if not steps.size or steps.max() <= _SHORTEST_GAP_US:
        return time, given
    longest = max(_LONG_GAP * float(np.median(steps)), _SHORTEST_GAP_US)
    behind = np.flatnonzero(steps > longest) + 1
    if not behind.size:
        return time, given
    filled = [np.insert(one, behind, False if one.dtype == bool else np.nan) for one in given]
    return np.insert(time, behind, time[behind - 1] + 100), filled
