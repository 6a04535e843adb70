"""From what is shown of a flight to bytes: thinned as far as they have to fit."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from fusetune.px4.aid_sources import AID_SOURCES
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
from fusetune.report.flight_data.panel_names import BIASES, SENSORS, UNCERTAINTY, VIBRATION, WIND_AND_FIELD
from fusetune.report.flight_data.preparing import FINEST, kept_rows_of
from fusetune.report.flight_data.series_colours import coloured
from fusetune.report.flight_data.thinning import kept_rows

SMALL_BUDGET_BYTES = 300_000
"""Of the blob of a flight in the report, in base64."""
LARGE_BUDGET_BYTES = 2_000_000
"""Of the blob in the page of a flight, in base64."""


class Buckets(NamedTuple):
    """Into how many buckets a series is parted: of sets that matter most, of the others, of what changes slowly."""

    main: int
    other: int
    slow: int


_COARSEST = 4
_STEP = 0.86
_SHARES, _FEWEST = (0.5, 0.4), 2
"""Of the other buckets, of those of the sets that matter most."""
_MAIN, _OTHER, _SLOW = range(len(Buckets._fields))


def _levels() -> tuple[Buckets, ...]:
    """From the finest to the coarsest."""
    found, main = [], float(FINEST)
    while main >= _COARSEST:
        found.append(Buckets(round(main), *(max(round(share * main), _FEWEST) for share in _SHARES)))
        main *= _STEP
    return tuple(found)


_LEVELS = _levels()
_SLOW_GROUPS = frozenset({BIASES, WIND_AND_FIELD, UNCERTAINTY, VIBRATION, SENSORS})
_IMPORTANT = ("present", "chosen", "onboard")
_NOT_WORTH = 2
"""So few levels finer are not worth packing once more."""
_AIMED = 0.98
"""Share of the budget: not every level takes what another one lets expect."""
_BYTES_OF_FIGURE, _BYTES_OF_TIME, _BYTES_OF_SERIES = 1.95, 0.85, 22.0
"""What a kept point takes in the end, about; the first guess at a level is made of them."""


def pack_content(content: FlightContent, budget_bytes: int) -> bytes:
    """The blob of a flight whose base64 takes no more than the budget, as fine as that allows.

    Where even the coarsest takes more, that is what is given.

    Parameters
    ----------
    content : with panels that were made ready (`fusetune.report.flight_data.preparing`)
    """
    important = {one.name for one in content.sets if one.role in _IMPORTANT}
    most = budget_bytes // 4 * 3
    guesses = _guesses(content.panels, important)
    number = _first_below(guesses, most)
    blob = _packed(content, important, _LEVELS[number])
    # what one level took says what the others take
    scale = len(blob) / guesses[number]
    better = _first_below(guesses, _AIMED * most / scale)
    if len(blob) > most or better + _NOT_WORTH < number:
        number, blob = better, _packed(content, important, _LEVELS[better])
    while len(blob) > most and number + 1 < len(_LEVELS):
        number += 1
        blob = _packed(content, important, _LEVELS[number])
    return blob


def fits(blob: bytes, budget_bytes: int) -> bool:
    """Whether the base64 of a blob takes no more than a budget: four characters for three bytes."""
    return -(-len(blob) // 3) * 4 <= budget_bytes


def _first_below(guesses: Sequence[float], most: float) -> int:
    return next((number for number, one in enumerate(guesses) if one <= most), len(guesses) - 1)


def _guesses(panels: Iterable[Panel], important: set[str]) -> list[float]:
    """What the blob takes at each of the levels, about."""
    series = [(panel, one) for panel in panels for one in panel.series]
    sizes = np.array([one.time.size for _, one in series], np.int64)
    kept = np.array([2 if one.peaks is None else 3 for _, one in series], np.int64)
    costs = np.array([_BYTES_OF_TIME + _BYTES_OF_FIGURE * (1 + (one.sigma is not None)) for _, one in series])
    which = np.array([_kind_of(*one, important) for one in series], np.int64)
    points = (np.minimum(sizes, kept * np.array(one)[which]) for one in _LEVELS)
    return [float(np.sum(_BYTES_OF_SERIES + costs * each)) for each in points]


def _kind_of(panel: Panel, series: Series, important: set[str]) -> int:
    """Which of the `Buckets` a series has, by number."""
    source = AID_SOURCES.get(panel.source or "")
    if panel.group in _SLOW_GROUPS or (source is not None and source.every_update):
        return _SLOW
    return _MAIN if series.set is None or series.set in important else _OTHER


def _packed(content: FlightContent, important: set[str], buckets: Buckets) -> bytes:
    arrays = ArrayStore()
    writer = _Writer(content, arrays)
    panels = [writer.panel(one, important, buckets) for one in content.panels]
    sets = [one._asdict() for one in content.sets]
    track = None if content.track is None else writer.track(content.track, buckets)
    header = {
        "version": VERSION,
        "flight": content.flight,
        "label": content.label,
        "start_us": content.start_us,
        "duration_s": round(content.duration_s, 4),
        "takeoff_s": _seconds(content.takeoff_s),
        "landing_s": _seconds(content.landing_s),
        "sets": sets,
        "arrays": arrays.entries,
        "panels": coloured(panels, sets),
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

    def __init__(self, content: FlightContent, arrays: ArrayStore) -> None:
        self._start, self._arrays = content.start_us, arrays

    def seconds(self, time: int) -> float:
        return round((time - self._start) * 1e-6, 4)

    def span(self, one: Span) -> list[Any]:
        return [max(self.seconds(one.start), 0.0), self.seconds(one.stop), one.words]

    def panel(self, panel: Panel, important: set[str], buckets: Buckets) -> dict[str, Any]:
        series = [self._series(one, buckets[_kind_of(panel, one, important)]) for one in panel.series]
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
        rows, rejected = kept_rows_of(series, buckets), series.rejected
        return {
            "label": series.label,
            "set": series.set,
            "time": self._times(series.time[rows]),
            "value": self._arrays.figures(series.values[rows]),
            "sigma": None if series.sigma is None else self._arrays.figures(series.sigma[rows]),
            "gate": series.gate,
            "rejected": None if rejected is None or not rejected.any() else self._arrays.flags(rejected[rows]),
            "draw": series.draw,
            "samples": series.samples,
            "rejected_samples": series.rejected_samples,
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
        rows = rows[track.time[rows] >= self._start]
        columns = {name: getattr(track, name)[rows] for name in ("north", "east", "height", "heading")}
        return {
            "time": self._times(track.time[rows]),
            **{name: self._arrays.figures(values) for name, values in columns.items()},
        }

    def _times(self, time: Times) -> int:
        return self._arrays.times(np.rint((time - self._start) / TICK_US).astype(np.int64))


def _union(rows: Iterable[Times]) -> Times:
    return np.unique(np.concatenate([*rows]))
