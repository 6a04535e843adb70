"""When something was so: flight modes, states of the vehicle, what was fused, what was wrong."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.phases import airborne_intervals, intervals_where
from fusetune.finding import from_documents
from fusetune.px4.flight import TopicTable
from fusetune.px4.flight_modes import ARMED, flight_mode
from fusetune.report.flight_data.content import Band, Span
from fusetune.report.flight_data.flag_words import ALARMS, FLAG_WORDS, GNSS_CHECK_WORDS, STATES, USUAL
from fusetune.report.flight_data.logged import Logged

_MOST_SPANS = 400
"""Of a flag that flickers: what lies next to each other is told as one."""


def bands(logged: Logged, replayed: TopicTable | None, scoring: Mapping[str, Any] | None) -> Iterator[Band]:
    """What held for a part of the flight, those that never were left out.

    Parameters
    ----------
    replayed : status flags of the replay of the present set; None where there is none
    scoring : `scoring.json`, likewise
    """
    last = logged.flight.last_timestamp
    yield from _of_vehicle(logged, last)
    if scoring is not None:
        cuts = [
            Span(one.start_us, one.stop_us, one.found)
            for one in from_documents(scoring.get("cuts"))
            if one.start_us is not None and one.stop_us is not None
        ]
        yield from _band("not_scored", "not scored", cuts)
    own = logged.status_flags
    flags = replayed if replayed is not None else own
    for band in _of_flags(flags, (*STATES, *ALARMS), last, "", ""):
        if band.id not in USUAL or len(band.spans) > 1 or not _holds(band.spans[0], logged):
            yield band
    yield from _gnss_checks(logged, last)
    if flags is not own:
        yield from _of_flags(own, ALARMS, last, "onboard.", ", as flown")


def _of_vehicle(logged: Logged, last: int) -> Iterator[Band]:
    airborne = airborne_intervals(logged.flight, logged.status_flags or {})
    yield from _band("in_air", "in the air", [Span(*one) for one in airborne])
    status = logged.topic("vehicle_status")
    if status is None:
        return
    time = status["timestamp"].astype(np.int64)
    if "nav_state" in status:
        yield from _band("nav_state", "flight mode", _spans_of_values(time, status["nav_state"], last))
    if "arming_state" in status:
        yield from _band("armed", "armed", _spans(time, status["arming_state"] == ARMED, last))
    if "failsafe" in status:
        yield from _band("failsafe", "failsafe", _spans(time, status["failsafe"].astype(bool), last))


def _gnss_checks(logged: Logged, last: int) -> Iterator[Band]:
    """Checks of the vehicle's own filter that failed, those that EKF2_GPS_CHECK asks for, and that of the fix."""
    status = logged.of_primary("estimator_status")
    if status is None or "gps_check_fail_flags" not in status or logged.topic("vehicle_gps_position") is None:
        return
    time, failed = status["timestamp"].astype(np.int64), status["gps_check_fail_flags"].astype(np.int64)
    asked = int(logged.parameters["EKF2_GPS_CHECK"]) << 1 | 1
    for bit, words in enumerate(GNSS_CHECK_WORDS):
        if asked >> bit & 1:
            spans = _spans(time, (failed >> bit & 1).astype(bool), last)
            yield from _band(f"gnss_check.{bit}", f"GNSS check failed: {words}", spans)


def _holds(span: Span, logged: Logged) -> bool:
    """Whether it holds throughout the time in the air, or the log where that is not known."""
    airborne = airborne_intervals(logged.flight, logged.status_flags or {})
    edges = (airborne[0][0], airborne[-1][1]) if airborne else (logged.flight.start_timestamp, span.stop)
    return span.start <= edges[0] and span.stop >= edges[1]


def _of_flags(flags: TopicTable | None, names: Sequence[str], last: int, prefix: str, whose: str) -> Iterator[Band]:
    if flags is None or not flags["timestamp"].size:
        return
    time = flags["timestamp"].astype(np.int64)
    for name in names:
        if name in flags:
            yield from _band(f"{prefix}{name}", FLAG_WORDS[name] + whose, _spans(time, flags[name].astype(bool), last))


def _band(name: str, label: str, spans: Sequence[Span]) -> Iterator[Band]:
    if spans:
        yield Band(name, label, _fewer(spans))


def _spans(time: npt.NDArray[np.int64], active: npt.NDArray[np.bool_], last: int) -> list[Span]:
    return [Span(*one) for one in intervals_where(time, active, last)]


def _spans_of_values(time: npt.NDArray[np.int64], modes: npt.NDArray[Any], last: int) -> list[Span]:
    starts = np.flatnonzero(np.r_[True, np.diff(modes.astype(np.int64)) != 0])
    stops = [*time[starts[1:]].tolist(), max(last, int(time[-1]))]
    return [
        Span(int(time[row]), stop, flight_mode(int(modes[row])))
        for row, stop in zip(starts.tolist(), stops, strict=True)
    ]


def _fewer(spans: Sequence[Span]) -> tuple[Span, ...]:
    """Of too many spans those nearest to each other joined, if they say the same."""
    found = list(spans)
    while len(found) > _MOST_SPANS:
        gaps = np.array([right.start - left.stop for left, right in pairwise(found)])
        closed = gaps <= np.partition(gaps, len(gaps) - _MOST_SPANS)[len(gaps) - _MOST_SPANS]
        joined = [found[0]]
        for one, is_closed in zip(found[1:], closed.tolist(), strict=True):
            if is_closed and one.words == joined[-1].words:
                joined[-1] = joined[-1]._replace(stop=one.stop)
            else:
                joined.append(one)
        if len(joined) == len(found):
            break
        found = joined
    return tuple(found)
