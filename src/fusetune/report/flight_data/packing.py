"""From what is shown of a flight to bytes: thinned as far as they have to fit."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from fusetune.report.flight_data.blob import TICK_US, VERSION, ArrayStore, pack
from fusetune.report.flight_data.content import (
    FlightContent,
    Panel,
    PlaneTrack,
    Series,
    Span,
    Times,
    TrackView,
)
from fusetune.report.flight_data.thinning import kept_rows

SMALL_BUDGET_BYTES = 300_000
"""Of the blob of a flight in the report, in base64."""
LARGE_BUDGET_BYTES = 2_000_000
"""Of the blob in the page of a flight, in base64."""


class Buckets(NamedTuple):
    """Into how many buckets a series is parted: of the sets that matter most and of the others."""

    main: int
    other: int


_LEVELS = tuple(
    Buckets(main, other)
    for main, other in (
        (1500, 1000), (1200, 600), (900, 400), (700, 250), (500, 180), (400, 130), (300, 100), (250, 80), (200, 60),
        (160, 48), (130, 36), (100, 28), (80, 20), (60, 14), (40, 10), (24, 6), (12, 4), (6, 2),
    )
)  # fmt: skip
"""From the finest to the coarsest."""

_IMPORTANT = ("present", "chosen", "onboard")
_BYTES_OF_FIGURE, _BYTES_OF_TIME, _BYTES_OF_SERIES = 2.7, 1.2, 30.0
"""What a kept point takes in the end, about; the first guess at a level is made of them."""


def pack_content(content: FlightContent, budget_bytes: int) -> bytes:
    """The blob of a flight whose base64 takes no more than the budget, as fine as that allows.

    Where even the coarsest takes more, that is what is given.
    """
    important = {one.name for one in content.sets if one.role in _IMPORTANT}
    most = budget_bytes * 3 // 4
    level = next(
        (i for i, one in enumerate(_LEVELS) if _guess(content.panels, important, one) <= most), len(_LEVELS) - 1
    )
    # of the two levels about the guess the finer one that fits
    for number in range(max(level - 1, 0), len(_LEVELS)):
        blob = _packed(content, important, _LEVELS[number])
        if len(blob) <= most:
            return blob
    return blob


def _guess(panels: Iterable[Panel], important: set[str], buckets: Buckets) -> float:
    return sum(_guess_of(one, _buckets_of(one, important, buckets)) for panel in panels for one in panel.series)


def _guess_of(series: Series, buckets: int) -> float:
    points = min(series.time.size, (3 if series.peaks is not None else 2) * buckets)
    figures = 1 + (series.sigma is not None)
    return _BYTES_OF_SERIES + points * (figures * _BYTES_OF_FIGURE + _BYTES_OF_TIME)


def _buckets_of(series: Series, important: set[str], buckets: Buckets) -> int:
    return buckets.main if series.set is None or series.set in important else buckets.other


def _packed(content: FlightContent, important: set[str], buckets: Buckets) -> bytes:
    arrays = ArrayStore()
    writer = _Writer(content.start_us, arrays)
    panels = [writer.panel(one, important, buckets) for one in content.panels]
    track = None if content.track is None else writer.track(content.track, buckets)
    header = {
        "version": VERSION,
        "flight": content.flight,
        "label": content.label,
        "start_us": content.start_us,
        "duration_s": round(content.duration_s, 4),
        "takeoff_s": _seconds(content.takeoff_s),
        "landing_s": _seconds(content.landing_s),
        "sets": [one._asdict() for one in content.sets],
        "arrays": arrays.entries,
        "panels": panels,
        "bands": [
            {"id": one.id, "label": one.label, "spans": [writer.span(each) for each in one.spans]}
            for one in content.bands
        ],
        "marks": [
            {
                "t0": round(one.since_s, 4),
                "t1": round(one.until_s, 4),
                "severity": one.severity,
                "id": one.id,
                "title": one.title,
            }
            for one in content.marks
        ],
        "events": [
            {"t": writer.seconds(one.time), "kind": one.kind, "title": one.title}
            for one in content.events
            if one.time >= content.start_us
        ],
        "track": track,
    }
    return pack(header, arrays.content)


def _seconds(value: float | None) -> float | None:
    return None if value is None else round(value, 4)


class _Writer:
    """Puts parts of a flight into the arrays of its blob, and says where."""

    def __init__(self, start_us: int, arrays: ArrayStore) -> None:
        self._start, self._arrays = start_us, arrays

    def seconds(self, time: int) -> float:
        return round((time - self._start) * 1e-6, 4)

    def span(self, one: Span) -> list[Any]:
        return [max(self.seconds(one.start), 0.0), self.seconds(one.stop), one.words]

    def panel(self, panel: Panel, important: set[str], buckets: Buckets) -> dict[str, Any]:
        series = [self._series(one, _buckets_of(one, important, buckets)) for one in panel.series]
        return {
            "id": panel.id,
            "group": panel.group,
            "title": panel.title,
            "unit": panel.unit,
            "source": panel.source,
            "axis": panel.axis,
            "kind": panel.kind,
            "log": panel.log,
            "limit": panel.limit,
            "series": series,
        }

    def _series(self, series: Series, buckets: int) -> dict[str, Any]:
        peaks = () if series.peaks is None else (series.peaks,)
        rows = kept_rows(series.values, buckets, peaks, series.rejected)
        rejected = series.rejected
        return {
            "label": series.label,
            "set": series.set,
            "style": series.style,
            "time": self._times(series.time[rows]),
            "value": self._arrays.figures(series.values[rows]),
            "sigma": None if series.sigma is None else self._arrays.figures(series.sigma[rows]),
            "gate": series.gate,
            "rejected": None if rejected is None or not rejected.any() else self._arrays.flags(rejected[rows]),
            "draw": series.draw,
            "samples": int(np.isfinite(series.values).sum()),
            "rejected_samples": None if rejected is None else int(rejected.sum()),
        }

    def track(self, track: TrackView, buckets: Buckets) -> dict[str, Any]:
        written = self._plane(track.flown, buckets.main)
        if track.gnss is not None:
            gnss = self._plane(track.gnss, buckets.main)
            written |= {f"gnss_{name}": gnss[name] for name in ("time", "north", "east", "height")}
        return written | {
            "sets": {name: self._plane(one, buckets.other) for name, one in track.sets.items()},
            "mission": [list(one) for one in track.mission],
            "manoeuvres": [self.span(one) for one in track.manoeuvres],
        }

    def _plane(self, track: PlaneTrack, buckets: int) -> dict[str, Any]:
        rows = _union(kept_rows(one, buckets) for one in (track.north, track.east, track.height))
        columns = {name: getattr(track, name)[rows] for name in ("north", "east", "height", "heading")}
        return {
            "time": self._times(track.time[rows]),
            **{name: self._arrays.figures(values) for name, values in columns.items()},
        }

    def _times(self, time: Times) -> int:
        return self._arrays.times(np.rint((time - self._start) / TICK_US).astype(np.int64))


def _union(rows: Iterable[Times]) -> Times:
    return np.unique(np.concatenate([*rows]))
