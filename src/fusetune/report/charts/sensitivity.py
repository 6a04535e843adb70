"""One small curve per parameter: how the prediction error goes along it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from fusetune.apply.sensitivity.result import (
    FLAT,
    MATTERS,
    NOT_TOLD,
    UNSURE,
    Curve,
    ParameterSensitivity,
    Sensitivity,
)
from fusetune.apply.sensitivity.wording import listed
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS
from fusetune.report.charts.blocks import chart_block
from fusetune.report.charts.svg.axes import HEAD, LABEL_ROOM, NARROW, TICK_ROOM, Panel, head, x_axis, y_axis, y_room
from fusetune.report.charts.svg.elements import area, dots, group, hinted, line, path, rectangle, svg, text
from fusetune.report.charts.svg.legend import Entry, legend, line_symbol, marker_symbol, patch_symbol
from fusetune.report.charts.svg.markers import marker
from fusetune.report.charts.svg.scales import Linear, Log, figure, percent, signed_figure
from fusetune.report.comparison import percent_change

Array = npt.NDArray[np.float64]

_HEIGHT = 120.0
_LEAST_REACH = 2.0
_FURTHEST_WORSE = 25.0
"""Percent: how much worse no longer matters, and must not squeeze what does."""
_WORDS = {MATTERS: "matters", FLAT: "hardly matters", UNSURE: "not sure"}
_LOOKS = {MATTERS: "set-1", FLAT: "good", UNSURE: "quiet"}


def sensitivity_chart(found: Sensitivity | None) -> str:
    """Small multiples of the told parameters, those that matter first, all with the same axis of errors; empty where
    the sets tell of none by itself."""
    if found is None:
        return ""
    told = [one for verdict in (MATTERS, UNSURE, FLAT) for one in found.of_verdict(verdict)]
    told = [one for one in told if one.curve is not None]
    if not told:
        return ""
    limits = _limits(told)
    entries = _entries(found, told)
    charts = [_panel(one, found, limits, entries if one is told[0] else ()) for one in told]
    return chart_block(_title(found), charts)


def _title(found: Sensitivity) -> str:
    """The answer, then what is not drawn."""
    matter = [one.parameter for one in found.of_verdict(MATTERS)]
    answer = f"What matters here: {listed(matter)}" if matter else "No parameter is shown to matter here"
    untold = [one.parameter for one in found.parameters if one.verdict == NOT_TOLD]
    return answer + (f". Not told apart, so not drawn: {listed(untold)}" if untold else "")


def _limits(told: Sequence[ParameterSensitivity]) -> tuple[float, float]:
    curves = [percent_change(one.curve.differences) for one in told if one.curve is not None]
    best = min(min(float(one.min()) for one in curves), -_LEAST_REACH)
    worst = max(max(float(one.max()) for one in curves), _LEAST_REACH)
    worst = min(worst, max(_FURTHEST_WORSE, -1.5 * best))
    margin = 0.12 * (worst - best)
    return best - margin, worst + margin


def _panel(one: ParameterSensitivity, found: Sensitivity, limits: tuple[float, float], entries: Sequence[Entry]) -> str:
    curve = one.curve
    assert curve is not None, "what is told of has a curve"
    y = Linear(*limits, HEAD + 20.0 + _HEIGHT, HEAD + 20.0)
    low, high = min(curve.values), max(curve.values)
    kind = Log if one.scale == "log" and low > 0.0 else Linear
    panel = Panel(kind(low, high, y_room(y, signed_figure), NARROW - 10.0), y)
    unit = PARAMETERS[one.parameter].unit if one.parameter in PARAMETERS else ""
    parts = [
        head(one.parameter),
        text(NARROW - 2.0, 12.0, _WORDS[one.verdict], "is-chosen" if one.verdict == MATTERS else "note", "end"),
    ]
    if one.same_within is not None:
        x1, x2 = (panel.x.at(min(max(end, low), high)) for end in one.same_within)
        parts.append(group("good", rectangle(x1, panel.top, x2, panel.bottom, "band")))
    parts.append(y_axis(panel, "change of the errors [%]", words=signed_figure))
    parts.append(x_axis(panel, unit.replace("^2", "²")))
    parts.append(line(panel.left, y.at(0.0), panel.right, y.at(0.0), "zero"))
    parts.append(_curves(panel, curve, _LOOKS[one.verdict]))
    parts.append(_tried(panel, one, found))
    if panel.x.holds(one.present):
        place = panel.x.at(one.present)
        parts.append(
            hinted(f"flies now: {figure(one.present)} {unit}", line(place, panel.top, place, panel.bottom, "now"))
        )
    if _is_moved(one) and panel.x.holds(one.incumbent):
        change = float(np.interp(one.incumbent, curve.values, percent_change(curve.differences)))
        where = (panel.x.at(one.incumbent), panel.y.at(min(max(change, limits[0]), limits[1])))
        hint = f"chosen: {figure(one.incumbent)} {unit}, {percent(change)}"
        parts.append(group("set-1", hinted(hint, marker("diamond", *where, 4.5))))
    below = panel.bottom + TICK_ROOM + (LABEL_ROOM if unit else 0.0) + 4.0
    drawn, height = legend(entries, below)
    most = percent(float(percent_change(one.change)))
    said = f"{_WORDS[one.verdict]}; now {figure(one.present)} {unit}; errors change by up to {most}"
    return svg("sensitivity", one.parameter, said, NARROW, below + height, [*parts, drawn], "")


def _entries(found: Sensitivity, told: Sequence[ParameterSensitivity]) -> list[Entry]:
    """Of what is drawn in any panel, in the colour of the first one."""
    look = _LOOKS[told[0].verdict]
    curves = [one.curve for one in told if one.curve is not None]
    entries = [(True, Entry(line_symbol(look), "others as chosen"))]
    entries += [
        (any(one.lower for one in curves), Entry(patch_symbol(look), f"{found.confidence:.0%} interval")),
        (any(one.others_at_best for one in curves), Entry(line_symbol("quiet", "dashed"), "others at their best")),
        (any(one.same_within for one in told), Entry(patch_symbol("good"), "hardly changes")),
        (True, Entry(line_symbol("ink", "now"), "flies now")),
        (any(map(_is_moved, told)), Entry(marker_symbol("set-1", "diamond"), "chosen")),
        (True, Entry(marker_symbol("ink", "circle", hollow=True), "a set that changes this alone")),
    ]
    return [entry for is_drawn, entry in entries if is_drawn]


def _is_moved(one: ParameterSensitivity) -> bool:
    """Whether the choice has another value than flies now."""
    return not math.isclose(one.incumbent, one.present, rel_tol=1e-5)


def _curves(panel: Panel, curve: Curve, look: str) -> str:
    x = panel.x(curve.values)

    def down(differences: Sequence[float]) -> Array:
        return np.clip(panel.y(percent_change(differences)), panel.top, panel.bottom)

    parts = []
    if curve.lower:
        parts.append(group(look, area(x, down(curve.lower), down(curve.upper), "band")))
    if curve.others_at_best:
        parts.append(group("quiet", path(x, down(curve.others_at_best), "dashed")))
    parts.append(group(look, path(x, down(curve.differences), "line")))
    return "".join(parts)


def _tried(panel: Panel, one: ParameterSensitivity, found: Sensitivity) -> str:
    """Sets that change this parameter: those that change it alone as rings, the others as dots."""
    index = [other.parameter for other in found.parameters].index(one.parameter)
    present = np.array([other.present for other in found.parameters])
    others = np.arange(len(present)) != index
    parts: list[str] = []
    others_places: list[tuple[float, float]] = []
    for tried in found.tried:
        values, change = np.array(tried.values), float(percent_change(tried.difference))
        if math.isclose(values[index], present[index], rel_tol=1e-5):
            continue
        if not (panel.x.holds(values[index]) and panel.y.holds(change)):
            continue
        x, y = panel.x.at(float(values[index])), panel.y.at(change)
        if np.all(np.isclose(values[others], present[others], rtol=1e-5)):
            hint = f"{tried.name}: {figure(float(values[index]))}, {percent(change)}"
            parts.append(hinted(hint, marker("circle", x, y, 3.0, hollow=True)))
        else:
            others_places.append((x, y))
    # of sets that would lie on each other one is drawn
    places = 2.5 * np.round(np.array(others_places).reshape(-1, 2) / 2.5)
    return group("quiet", dots(places[:, 0], places[:, 1], 1.5, "dot")) + group("ink", *parts)
