"""What a search is worth on flights that it saw and on those kept aside, and each parameter that it changes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from fusetune.report.charts.blocks import chart_block
from fusetune.report.charts.pareto import search_pareto_chart
from fusetune.report.charts.svg.axes import HEAD, LABEL_ROOM, NARROW, TICK_ROOM, Panel, x_axis
from fusetune.report.charts.svg.elements import group, hinted, line, rectangle, svg, text
from fusetune.report.charts.svg.legend import Entry, legend, line_symbol, marker_symbol, patch_symbol
from fusetune.report.charts.svg.markers import marker
from fusetune.report.charts.svg.rows import Rows, rows_of
from fusetune.report.charts.svg.scales import Linear, percent, signed_figure
from fusetune.report.charts.svg.text_width import text_width
from fusetune.report.counted import count_words
from fusetune.report.flight_names import short_names
from fusetune.report.search_results import SearchResults
from fusetune.report.searched_parameters import axis_groups, found_title, from_to_words
from fusetune.set_names import FOUND

_ROW = 22.0
_FOUND_ROW = 40.0
_RIGHT = 12.0
_CHANGE = "change of the prediction error [%]"
_REACH = 2.0
"""An interval that is so many times wider than all bars runs out of the picture and does not squeeze them."""


def kept_aside_chart(results: SearchResults) -> str:
    """A bar for each flight, what was found without it is worth there, and what to expect with its interval; empty
    with a single flight."""
    changes = {str(name): -float(gain) for name, gain in results.search["kept_aside"].items() if gain is not None}
    if not changes:
        return ""
    expected = results.search["expected_gain"]
    mean, ends = _expected(expected)
    short = short_names(changes)
    rows = rows_of([short[name] for name in changes], 6.0, _ROW)
    panel = _change_panel(rows, _within_reach(list(changes.values()), [*ends, *([] if mean is None else [mean])]))
    parts = [_better(panel)]
    entries: list[Entry] = []
    if ends:
        low, high = (min(max(panel.x.at(end), panel.left), panel.right) for end in ends)
        hint = f"95 % interval of what to expect: {percent(ends[0])} to {percent(ends[1])}"
        parts.append(group("set-1", hinted(hint, rectangle(low, panel.top, high, panel.bottom, "band"))))
        entries.append(Entry(patch_symbol("set-1"), "95 % interval"))
    parts += [x_axis(panel, _CHANGE, words=signed_figure), rows.labels(), _zero(panel)]
    if mean is not None and panel.x.holds(mean):
        place = panel.x.at(mean)
        parts.append(hinted(f"expected: {percent(mean)}", line(place, panel.top, place, panel.bottom, "now")))
        entries.insert(0, Entry(line_symbol("ink", "now"), "to be expected on as many flights again"))
    for row, (name, change) in enumerate(changes.items()):
        parts.append(_bar(panel, rows.y(row), name, change))
    said = "; ".join(f"{name}: {percent(change)}" for name, change in changes.items())
    title = _kept_aside_title(list(changes.values()), mean, ends)
    return chart_block(title, [_finished("kept-aside", title, said, panel, parts, entries)])


def _bar(panel: Panel, y: float, name: str, change: float) -> str:
    end = panel.x.at(change)
    bar = rectangle(panel.x.at(0.0), y - 7.0, end, y + 7.0, "fill")
    words, is_better = percent(change), change <= 0.0
    # beside the bar, or in the axes where there is no room beside
    beside = end - 4.0 if is_better else end + 4.0
    has_room = beside - text_width(words) > panel.left if is_better else beside + text_width(words) < panel.right
    place = beside if has_room else panel.x.at(0.0) + (4.0 if is_better else -4.0)
    anchor = "end" if is_better == has_room else "start"
    drawn = group("good" if is_better else "bad", hinted(f"{name}: {words}", bar))
    return drawn + text(place, y + 4.0, words, "over", anchor)


def _expected(expected: Mapping[str, float | None] | None) -> tuple[float | None, list[float]]:
    """What to expect, and the ends of its interval, as changes in percent."""
    if expected is None:
        return None, []
    mean, lower, upper = (expected[name] for name in ("percent", "lower_percent", "upper_percent"))
    ends = [-upper, -lower] if lower is not None and upper is not None else []
    return (None if mean is None else -mean), ends


def _kept_aside_title(changes: Sequence[float], mean: float | None, ends: Sequence[float]) -> str:
    better = sum(change < 0.0 for change in changes)
    words = f"Better on {better} of {count_words(len(changes), 'flight')} that the search did not see"
    if mean is None:
        return words
    span = f" ({percent(ends[0])} to {percent(ends[1])})" if ends else ""
    return f"{words}; expect {percent(mean)}{span}"


def shrinkage_chart(results: SearchResults) -> str:
    """For all parts together and for each: the change on the flights that the search saw, and on those kept aside;
    empty where none was kept aside."""
    search = results.search
    seen = [float(one["gain_in_search_percent"]) for one in results.parts if one["gain_in_search_percent"] is not None]
    mean = sum(seen) / len(seen) if seen else None
    told = [("mean of all parts", mean, search["gain_kept_aside_percent"], "")]
    for number, one in enumerate(results.parts, 1):
        aside = ", ".join(map(str, one["kept_aside"]))
        count = count_words(len(one["kept_aside"]), "flight")
        told.append(
            (f"without {count}, {number}", one["gain_in_search_percent"], one["gain_kept_aside_percent"], aside)
        )
    shown = [(name, -float(a), -float(b), of) for name, a, b, of in told if a is not None and b is not None]
    if not shown:
        return ""
    rows = rows_of([name for name, *_ in shown], 6.0, _ROW, kinds=["is-now", *[""] * (len(shown) - 1)])
    panel = _change_panel(rows, [value for _, a, b, _ in shown for value in (a, b)])
    parts = [_better(panel), x_axis(panel, _CHANGE, words=signed_figure), rows.labels(), _zero(panel)]
    for row, (_, before, after, aside) in enumerate(shown):
        y, x1, x2 = rows.y(row), panel.x.at(before), panel.x.at(after)
        hint = f"{percent(before)} on the flights searched on, {percent(after)} on those kept aside"
        size = 5.5 if row == 0 else 4.2
        drawn = (
            group("warn" if after > before else "good", line(x1, y, x2, y, "bar")),
            group("quiet", marker("circle", x1, y, size, hollow=True)),
            group("set-1", marker("diamond", x2, y, size)),
        )
        parts.append(hinted(f"{hint}: {aside}" if aside else hint, *drawn))
    entries = [
        Entry(marker_symbol("quiet", "circle", hollow=True), "flights that the search saw"),
        Entry(marker_symbol("set-1", "diamond"), "flights kept aside from it"),
        Entry(line_symbol("warn", "bar"), "luck"),
    ]
    title = _shrinkage_title(shown[0][1], shown[0][2])
    return chart_block(title, [_finished("shrinkage", title, title, panel, parts, entries)])


def _shrinkage_title(seen: float, aside: float) -> str:
    """The answer first: how much of the gain was luck."""
    told = f"{percent(seen)} on the flights searched on, {percent(aside)} on flights kept aside"
    if seen >= 0.0:
        return f"The search found no gain: {told}"
    if aside >= 0.0:
        return f"All of the gain was luck: {told}"
    if aside <= seen:
        return f"No luck in it: {told}"
    return f"{100.0 * (1.0 - aside / seen):.0f} % of the gain was luck: {told}"


def _change_panel(rows: Rows, values: Sequence[float]) -> Panel:
    low, high = min(0.0, *values), max(0.0, *values)
    margin = 0.09 * max(high - low, 1.0)
    return Panel(
        Linear(low - margin, high + margin, rows.room, NARROW - _RIGHT),
        Linear(len(rows.names), 0.0, rows.bottom, rows.top),
    )


def _within_reach(values: Sequence[float], ends: Sequence[float]) -> list[float]:
    reach = _REACH * max(map(abs, values), default=1.0)
    return [*values, *(min(max(end, -reach), reach) for end in ends)]


def _better(panel: Panel) -> str:
    return rectangle(panel.left, panel.top, max(panel.x.at(0.0), panel.left), panel.bottom, "better")


def _zero(panel: Panel) -> str:
    return line(panel.x.at(0.0), panel.top, panel.x.at(0.0), panel.bottom, "zero")


def _finished(
    name: str, title: str, said: str, panel: Panel, parts: Sequence[str], entries: Sequence[Entry], label: bool = True
) -> str:
    below = panel.bottom + TICK_ROOM + (LABEL_ROOM if label else 0.0) + 4.0
    drawn, height = legend(entries, below)
    return svg(name, title, said, NARROW, below + height, [*parts, drawn], "")


def found_chart(results: SearchResults) -> str:
    """A row for each parameter, from where to where: ratios on one axis, delays and lever arms on their own; empty
    where none was searched."""
    parameters: Mapping[str, Mapping[str, Any]] = results.search["parameters"]
    if not parameters:
        return ""
    charts: list[str] = []
    for unit, names in axis_groups(parameters).items():
        folds = {name: [float(one["values"][name]) for one in results.parts] for name in names}
        charts.append(_found_panel(names, parameters, folds, unit, with_legend=not charts))
    return chart_block(found_title(parameters), charts)


def _found_panel(
    names: Sequence[str],
    parameters: Mapping[str, Mapping[str, Any]],
    folds: Mapping[str, Sequence[float]],
    unit: str | None,
    *,
    with_legend: bool,
) -> str:
    def placed(name: str) -> Callable[[float], float]:
        now = float(parameters[name]["present"])
        return (lambda value: math.log2(value / now)) if unit is None else (lambda value: value - now)

    ends = [placed(name)(float(parameters[name][end])) for name in names for end in ("low", "high", "found")]
    low, high = min(*ends, 0.0), max(*ends, 0.0)
    margin = 0.04 * max(high - low, 1e-9)
    top = HEAD
    bottom = top + _FOUND_ROW * len(names)
    panel = Panel(Linear(low - margin, high + margin, 6.0, NARROW - _RIGHT), Linear(len(names), 0.0, bottom, top))
    ticks = None if unit is not None else [float(one) for one in range(math.ceil(low), math.floor(high) + 1)]
    if ticks is not None and len(ticks) > 6:
        ticks = [one for one in ticks if one % math.ceil(len(ticks) / 6) == 0]
    words = _ratio_words if unit is None else _shift_words
    label = "times what flies now" if unit is None else f"change [{unit}]" if unit else "change"
    parts = [x_axis(panel, label, ticks, words)]
    said = []
    for place, name in enumerate(names):
        one, at = parameters[name], placed(name)
        y = top + _FOUND_ROW * place
        told = from_to_words(name, one)
        said.append(f"{name}: {told}")
        parts.append(text(6.0, y + 12.0, name, "head over" if one["is_changed"] else "over"))
        parts.append(text(NARROW - _RIGHT, y + 12.0, told, "over" if one["is_changed"] else "note over", "end"))
        parts.append(_found_row(panel, one, at, folds[name], y + 26.0, f"{name}: {told}"))
    entries = [
        Entry(marker_symbol("set-0", "square"), "flies now"),
        Entry(marker_symbol("set-1", "diamond", through="line"), "found on all flights"),
        Entry(marker_symbol("warn", "circle"), "with a part kept aside (larger: several)"),
        Entry(line_symbol("quiet", "bar"), "what was allowed"),
    ]
    title = "What the search found" + ("" if unit is None else f" [{unit}]")
    return _finished("found", title, "; ".join(said), panel, parts, entries if with_legend else ())


def _found_row(
    panel: Panel, one: Mapping[str, Any], at: Callable[[float], float], folds: Sequence[float], y: float, hint: str
) -> str:
    low, high, found, now = (panel.x.at(at(float(one[name]))) for name in ("low", "high", "found", "present"))
    allowed = (line(low, y, high, y, "thin"), *(line(end, y - 4.0, end, y + 4.0, "line") for end in (low, high)))
    parts = [group("quiet", *allowed)]
    if one["is_changed"]:
        parts.append(group("set-1", line(now, y, found, y, "bar"), marker("diamond", found, y, 5.0)))
    parts.append(group("set-0", marker("square", now, y, 3.6)))
    parts += [
        group("warn", marker("circle", panel.x.at(at(value)), y + 7.0, 1.8 + 0.7 * count))
        for value, count in sorted(Counter(folds).items())
    ]
    return hinted(hint, *parts)


def _ratio_words(power: float) -> str:
    if power == 0.0:
        return "now"
    return f"×{2.0**power:.4g}" if power > 0.0 else f"÷{2.0**-power:.4g}"


def _shift_words(value: float) -> str:
    return "now" if abs(value) < 1e-9 else signed_figure(value, 3)


def found_pareto_chart(results: SearchResults) -> str:
    """All sets that a search tried in two aims; empty where no flight tells of both."""
    return search_pareto_chart(results.trials, FOUND, "what the search found")
