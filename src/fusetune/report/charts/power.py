"""The chance of finding a gain, by the number of flights."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any

from fusetune.report.charts.svg.axes import (
    LABEL_ROOM,
    NARROW,
    TICK_ROOM,
    Panel,
    fitting_ticks,
    head,
    x_axis,
    y_axis,
)
from fusetune.report.charts.svg.elements import group, hinted, line, path, svg, text
from fusetune.report.charts.svg.legend import Entry, legend, line_symbol, marker_symbol
from fusetune.report.charts.svg.markers import marker
from fusetune.report.charts.svg.scales import Linear
from fusetune.report.charts.svg.text_width import text_width
from fusetune.report.results import Results

_LOOKS = (("tone-0", "triangle"), ("tone-5", "square"), ("tone-1", "diamond"), ("tone-2", "circle"))
_TOP, _HEIGHT, _LEFT = 38.0, 150.0, 34.0


def power_chart(results: Results) -> str:
    """A curve for each gain, dashed for longer flights; empty where too little is known to reckon one."""
    power = results.decision["power"]
    if not power:
        return ""
    curves = [one for one in power["curves"] if len(one["flights"])]
    most = max(max(one["flights"]) for one in curves)
    least = min(min(one["flights"]) for one in curves)
    x = Linear(least - 0.5, max(most, power["flights"]) + 0.5, _LEFT, NARROW - 10.0)
    panel = Panel(x, Linear(0.0, 100.0, _TOP + _HEIGHT, _TOP))
    parts = [head("Chance that a gain would be found")]
    whole = [one for one in fitting_ticks(x) if one == round(one)]
    parts.append(x_axis(panel, "flights that decide", ticks=whole))
    parts.append(y_axis(panel, "chance [%]", ticks=[0.0, 25.0, 50.0, 75.0, 100.0]))
    asked = panel.y.at(100.0 * power["chance_asked_for"])
    parts.append(line(panel.left, asked, panel.right, asked, "expected"))
    entries: list[Entry] = []
    gains = sorted({float(one["gain_percent"]) for one in curves})
    for one in curves:
        kind, shape = _LOOKS[gains.index(float(one["gain_percent"])) % len(_LOOKS)]
        parts.append(group(kind, *_curve(panel, one, shape, power)))
        entries.append(_entry(one, kind, shape, power))
    parts.append(_now(panel, power["flights"]))
    entries.append(Entry(line_symbol("ink", "expected"), f"asked for: {power['chance_asked_for']:.0%}"))
    drawn, height = legend(entries, panel.bottom + TICK_ROOM + LABEL_ROOM + 4.0)
    parts.append(drawn)
    below = panel.bottom + TICK_ROOM + LABEL_ROOM + 4.0 + height
    return svg("power", "What more flights would find", _in_words(curves, power), NARROW, below, parts, "")


def _now(panel: Panel, flights: int) -> str:
    place, words = panel.x.at(flights), f"now: {flights}"
    is_left = place + 5.0 + text_width(words) > panel.right
    beside = text(
        place - 4.0 if is_left else place + 4.0, panel.bottom - 5.0, words, "over", "end" if is_left else "start"
    )
    return line(place, panel.top, place, panel.bottom, "now") + beside


def _is_longer(one: dict[str, Any]) -> bool:
    return bool(one["times_longer"] != 1.0)


def _minutes(one: dict[str, Any], power: dict[str, Any]) -> float:
    return float(power["next_minutes"] if _is_longer(one) else power["minutes"])


def _curve(panel: Panel, one: dict[str, Any], shape: str, power: dict[str, Any]) -> list[str]:
    x, y = panel.x(one["flights"]), panel.y([100.0 * chance for chance in one["chance"]])
    parts = [path(x, y, "dashed" if _is_longer(one) else "line")]
    if not _is_longer(one):
        for across, down, flights, chance in zip(x, y, one["flights"], one["chance"], strict=True):
            words = f"gain {one['gain_percent']:g} %, {flights} flights of {_minutes(one, power):.2g} min: {chance:.0%}"
            parts.append(hinted(words, marker(shape, float(across), float(down), 3.2)))
    return parts


def _entry(one: dict[str, Any], kind: str, shape: str, power: dict[str, Any]) -> Entry:
    words = f"gain {one['gain_percent']:g} %, flights of {_minutes(one, power):.2g} min"
    if _is_longer(one):
        return Entry(line_symbol(kind, "dashed"), words)
    return Entry(marker_symbol(kind, shape, through="line"), words)


def _in_words(curves: Sequence[dict[str, Any]], power: dict[str, Any]) -> str:
    said = []
    for gain, of_gain in groupby((one for one in curves if not _is_longer(one)), lambda one: one["gain_percent"]):
        for one in of_gain:
            found = zip(one["flights"], one["chance"], strict=True)
            enough = next((count for count, chance in found if chance >= power["chance_asked_for"]), None)
            said.append(f"a gain of {gain:g} % " + (f"takes {enough} flights" if enough else "takes more flights"))
    asked = f"to be found with a chance of {power['chance_asked_for']:.0%}"
    return f"At {power['flights']} flights now; {asked}: {', '.join(said)}."
