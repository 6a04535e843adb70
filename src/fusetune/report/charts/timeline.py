"""A flight in time: when it was in the air, and when which finding holds."""

from __future__ import annotations

import math
from collections.abc import Sequence

from fusetune.report.charts.blocks import two_forms
from fusetune.report.charts.svg.axes import LABEL_ROOM, NARROW, TICK_ROOM, WIDE, Panel, x_axis
from fusetune.report.charts.svg.elements import group, hinted, px, rectangle, svg, text
from fusetune.report.charts.svg.scales import Linear
from fusetune.report.charts.svg.text_width import BOLDER, ends_fitted, text_width
from fusetune.report.finding_bars import Bar, finding_bars
from fusetune.report.flight_results import FlightResults
from fusetune.report.severity_words import SEVERITY_WORDS

_LANE, _TALL_LANE = 20.0, 32.0
_RIGHT = 10.0
_MOST_WORDS = 0.36
_SHORTEST = 3.0
"""Pixels: an instant is to be seen as well."""
_LOOKS = {"fail": "bad", "warning": "warn", "note": "note-look"}


def timeline_chart(results: FlightResults) -> str:
    """A lane for each finding over the time of the log, and one for the time in the air; empty without a finding."""
    bars = list(finding_bars(results))
    if not bars:
        return ""
    times = results.times
    flown = (times.take_off_s, times.landing_s) if math.isfinite(times.take_off_s + times.landing_s) else None
    return two_forms(_chart(bars, flown, NARROW), _chart(bars, flown, WIDE))


def _chart(bars: Sequence[Bar], flown: tuple[float, float] | None, width: float) -> str:
    is_wide = width > NARROW
    lane = _LANE if is_wide else _TALL_LANE
    names = [*(bar.words for bar in bars), "in the air" if flown else "not known to fly"]
    room = min(max(map(text_width, names)) * 1.1 + 8.0, _MOST_WORDS * width) if is_wide else 2.0
    bottom = 4.0 + lane * len(names)
    x = Linear(0.0, max(*(bar.until_s for bar in bars), flown[1] if flown else 0.0, 1.0), room, width - _RIGHT)
    panel = Panel(x, Linear(len(names), 0.0, bottom, 4.0))
    parts = [rectangle(x.at(flown[0]), panel.top, x.at(flown[1]), panel.bottom, "ground")] if flown else []
    parts.append(x_axis(panel, "time since the log began [s]"))
    for place, bar in enumerate(bars):
        parts.append(_lane_words(bar.words, "head" if bar.is_cause else "", place, lane, room, width))
        parts.append(_bar(bar, panel, 4.0 + lane * (place + 1) - 0.5 * _LANE))
    parts.append(_lane_words(names[-1], "note", len(bars), lane, room, width))
    if flown:
        y = 4.0 + lane * len(names) - 0.5 * _LANE
        hint = f"in the air from {flown[0]:.1f} s to {flown[1]:.1f} s"
        parts.append(group("quiet", hinted(hint, rectangle(x.at(flown[0]), y - 4.0, x.at(flown[1]), y + 4.0, "fill"))))
    said = "; ".join(_in_words(bar) for bar in bars)
    height = panel.bottom + TICK_ROOM + LABEL_ROOM
    return svg("timeline", "What was found, and when", said, width, height, parts, "is-wide-chart" if is_wide else "")


def _lane_words(words: str, kind: str, place: int, lane: float, room: float, width: float) -> str:
    """Beside a lane, or above it where a phone has no room beside."""
    if lane == _LANE:
        shown = ends_fitted(words, (room - 8.0) / (BOLDER if kind == "head" else 1.0))
        drawn = text(room - 8.0, 4.0 + lane * (place + 0.5) + 4.0, shown, kind, "end")
    else:
        shown = ends_fitted(words, width / BOLDER)
        drawn = text(2.0, 4.0 + lane * place + 11.0, shown, f"{kind} over".strip())
    return drawn if shown == words else hinted(words, drawn)


def _bar(bar: Bar, panel: Panel, y: float) -> str:
    start, stop = panel.x.at(bar.since_s), panel.x.at(bar.until_s)
    stop = max(stop, start + _SHORTEST)
    half = 6.0 if bar.is_cause else 3.5
    # severities differ in more than their colour: what fails is full, what warns pale, a note hollow
    kind = {"fail": "fill", "warning": "box"}.get(bar.severity, "outline")
    shape = (
        f'<rect class="{kind}" x="{px(start)}" y="{px(y - half)}" width="{px(stop - start)}" height="{px(2 * half)}"/>'
    )
    return group(_LOOKS.get(bar.severity, "quiet"), hinted(_in_words(bar), shape))


def _in_words(bar: Bar) -> str:
    severity = SEVERITY_WORDS.get(bar.severity, bar.severity)
    return f"{bar.words}: {severity}, from {bar.since_s:.1f} s, {bar.until_s - bar.since_s:.1f} s long"
