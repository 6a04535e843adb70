"""Every set's prediction error against the present set's, with its interval, in all that sets are judged by."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from fusetune.apply.evidence import AIDED, AIMS, SMOOTHED, UNAIDED
from fusetune.apply.ranking import NOT_ELIGIBLE
from fusetune.report.charts.blocks import chart_block, figures_table
from fusetune.report.charts.set_looks import name_classes, set_class, set_group, set_marker
from fusetune.report.charts.svg.axes import HEAD, LABEL_ROOM, NARROW, TICK_ROOM, Panel, head, x_axis
from fusetune.report.charts.svg.elements import group, hinted, line, rectangle, svg, text
from fusetune.report.charts.svg.legend import Entry, dot_symbol, legend, marker_symbol
from fusetune.report.charts.svg.rows import rows_of
from fusetune.report.charts.svg.scales import Linear, percent, signed_figure
from fusetune.report.charts.svg.text_width import text_width
from fusetune.report.comparison import (
    AIM_LABELS,
    AIM_WORDS,
    SCORE,
    aim_changes,
    flight_changes,
    known_ends,
    robust_reach,
    told_aims,
)
from fusetune.report.counted import count_words
from fusetune.report.markup import Cell, signed
from fusetune.report.results import OUT, Results

Array = npt.NDArray[np.float64]

_ROW = 19.0
_BLOCK = 40.0
_RIGHT = 10.0
_FARTHEST = 2.5
"""Single flights may reach so many times as far as the intervals of their means before they are put at the edge."""
_COLUMNS = {SCORE: "score", AIDED: "aided_score", UNAIDED: "unaided_score", SMOOTHED: "smoothed_score"}
_OVERALL = "all together"


class _Told(NamedTuple):
    """What one kind of prediction says of one set: change and ends of its interval, and that of each flight; %."""

    aim: str
    change: float
    lower: float
    upper: float
    flights: Array


def answer_set(results: Results) -> str | None:
    """The set that the answer is about: what is chosen, or what came nearest to it; None where nothing was compared."""
    chosen, nearest = results.decision["chosen"], results.decision["best_candidate"]
    name = chosen if chosen != results.present else nearest
    if name is None or name == results.present:
        return None
    return str(name) if name in set(aim_changes(results, SCORE).index) else None


def answer_chart(results: Results) -> str:
    """The one figure of the answer: by how much the set that it is about errs less or more, in all it is judged by.

    Each row has a dot for each flight, and the mean with its interval; empty where nothing was compared.
    """
    name = answer_set(results)
    told = [] if name is None else [one for aim in (SCORE, *told_aims(results)) if (one := _told(results, name, aim))]
    if name is None or not told:
        return ""
    left, right = _answer_reach(told)
    top = HEAD + 16.0
    bottom = top + _BLOCK * len(told)
    panel = Panel(Linear(left, right, 2.0, NARROW - _RIGHT), Linear(len(told), 0.0, bottom, top))
    zero = panel.x.at(0.0)
    parts = [rectangle(panel.left, top, zero, bottom, "better"), _sides(panel)]
    parts.append(x_axis(panel, "change of the prediction error [%]", words=signed_figure))
    parts.append(line(zero, top, zero, bottom, "zero"))
    parts += [_answer_row(results, name, one, panel, top + _BLOCK * place) for place, one in enumerate(told)]
    parts.append(head(f"{name} against what flies now"))
    said = "; ".join(f"{_aim_words(one.aim)} {_in_words(one)}" for one in told)
    below, height = _answer_legend(results, name, bottom + TICK_ROOM + LABEL_ROOM + 4.0)
    parts.append(below)
    return svg("answer", f"{name} against what flies now", said, NARROW, height, parts, "")


def _told(results: Results, name: str, aim: str) -> _Told | None:
    changes = aim_changes(results, aim)
    if name not in changes.index:
        return None
    one = changes.loc[name]
    by_flight = flight_changes(results, _COLUMNS[aim])
    flights = by_flight[name].to_numpy(np.float64) if name in by_flight and len(by_flight) > 1 else np.zeros(0)
    change, lower, upper = (float(number) for number in one[["change", "lower", "upper"]].to_numpy(np.float64))
    return _Told(aim, change, lower, upper, flights[np.isfinite(flights)])


def _answer_reach(told: list[_Told]) -> tuple[float, float]:
    ends = [end for one in told for end in (one.change, one.lower, one.upper, 0.0) if math.isfinite(end)]
    flights = np.concatenate([one.flights for one in told])
    reach = _FARTHEST * max(*map(abs, ends), 1.0)
    low = min(*ends, *np.clip(flights, -reach, reach), -1.0)
    high = max(*ends, *np.clip(flights, -reach, reach), 1.0)
    margin = 0.05 * (high - low)
    return low - margin, high + margin


def _sides(panel: Panel) -> str:
    """Which side is which, above the axes, as far as there is room for the words."""
    y, zero = panel.top - 5.0, panel.x.at(0.0)
    better, worse = "← smaller errors", "larger errors →"
    parts = []
    if zero - panel.left > text_width(better):
        parts.append(text(zero - 6.0, y, better, "good", "end"))
    if panel.right - zero > text_width(worse):
        parts.append(text(zero + 6.0, y, worse, "bad"))
    return "".join(parts)


def _answer_row(results: Results, name: str, one: _Told, panel: Panel, top: float) -> str:
    y = top + 28.0
    shown = np.clip(panel.x(one.flights), panel.left, panel.right)
    dots = "".join(f'<circle class="dot" cx="{x:.1f}" cy="{y:.1f}" r="3.2"/>' for x in np.sort(shown))
    known = math.isfinite(one.lower) and math.isfinite(one.upper)
    low, high = (panel.x.at(end) if known else panel.x.at(one.change) for end in (one.lower, one.upper))
    interval = line(low, y, high, y, "bar") if known else ""
    mean = set_marker(results, name, panel.x.at(one.change), y, 5.5 if one.aim == SCORE else 4.5)
    kind = "head over" if one.aim == SCORE else "over"
    words = text(6.0, top + 14.0, f"{_aim_words(one.aim)}: {percent(one.change)}", kind)
    return words + set_group(results, name, _in_words(one), dots, interval, mean)


def _answer_legend(results: Results, name: str, top: float) -> tuple[str, float]:
    kind, confidence = set_class(results, name), results.decision["rule"]["confidence"]
    mean = marker_symbol(kind, results.styles[name].marker, through="bar")
    entries = [Entry(mean, f"mean and {confidence:.0%} interval")]
    if len(results.flights) > 1:
        entries.append(Entry(dot_symbol(kind), "a flight"))
    drawn, height = legend(entries, top)
    return drawn, top + height


def _aim_words(aim: str) -> str:
    return _OVERALL if aim == SCORE else AIM_WORDS[aim]


def _in_words(one: _Told) -> str:
    better = int(np.count_nonzero(one.flights < 0.0))
    on = f", smaller on {better} of {count_words(len(one.flights), 'flight')}" if len(one.flights) else ""
    return f"{percent(one.change)} ({_interval(one.lower, one.upper)}){on}"


def _interval(lower: float, upper: float) -> str:
    if not (math.isfinite(lower) and math.isfinite(upper)):
        return "interval not known"
    return f"interval {percent(lower)} to {percent(upper)}"


def differences_chart(results: Results) -> str:
    """A panel for all together and each kind of prediction, a row for each set; empty where nothing was compared."""
    names = [str(name) for name in aim_changes(results, SCORE).index if name in results.shown]
    if not names:
        return ""
    changes = {aim: found.reindex(names) for aim in (SCORE, *AIMS) if len(found := aim_changes(results, aim))}
    charts = [_panel(results, aim, changes[aim]) for aim in changes]
    confidence = results.decision["rule"]["confidence"]
    title = f"Prediction error against what flies now, mean over the flights with {confidence:.0%} interval"
    return chart_block(title, charts, _table(results, changes))


def _panel(results: Results, aim: str, changes: pd.DataFrame) -> str:
    names = [str(name) for name in changes.index]
    able = (~changes["status"].isin(OUT)).to_numpy()
    left, right = robust_reach(*known_ends(changes), able)
    rows = rows_of(names, HEAD + 4.0, _ROW, kinds=name_classes(results, names))
    panel = Panel(Linear(left, right, rows.room, NARROW - _RIGHT), Linear(len(names), 0.0, rows.bottom, rows.top))
    zero = panel.x.at(0.0)
    parts = [
        head(AIM_LABELS[aim][0].upper() + AIM_LABELS[aim][1:]),
        rectangle(panel.left, panel.top, zero, panel.bottom, "better"),
    ]
    parts += [x_axis(panel, "change of the error [%]; left is better", words=signed_figure), rows.labels()]
    parts.append(line(zero, panel.top, zero, panel.bottom, "zero"))
    said = []
    for row, (name, change, lower, upper) in enumerate(
        zip(names, changes["change"], changes["lower"], changes["upper"], strict=True)
    ):
        if math.isfinite(change):
            words = f"{percent(change)} ({_interval(lower, upper)})"
            said.append(f"{name} {words}")
            parts.append(_row(results, name, f"{name}: {words}", (change, lower, upper), panel, rows.y(row)))
    height = panel.bottom + TICK_ROOM + LABEL_ROOM
    return svg(
        "differences",
        f"Every set against what flies now: {AIM_LABELS[aim]}",
        "; ".join(said),
        NARROW,
        height,
        parts,
        "",
    )


def _row(results: Results, name: str, hint: str, told: tuple[float, float, float], panel: Panel, y: float) -> str:
    change, lower, upper = told
    low, high = max(panel.x.low, lower), min(panel.x.high, upper)
    known = math.isfinite(lower) and math.isfinite(upper) and low < high
    interval = line(panel.x.at(low), y, panel.x.at(high), y, "bar") if known else ""
    if panel.x.holds(change):
        return set_group(results, name, hint, interval, set_marker(results, name, panel.x.at(change), y))
    is_right = change > panel.x.high
    words = f"{percent(change, 0)} ▶" if is_right else f"◀ {percent(change, 0)}"
    edge = text(panel.right if is_right else panel.left, y + 4.0, words, "note over", "end" if is_right else "start")
    return group(set_class(results, name), hinted(hint, interval, edge))


def _table(results: Results, changes: Mapping[str, pd.DataFrame]) -> str:
    rows: list[list[Cell | str]] = []
    for name in map(str, changes[SCORE].index):
        row: list[Cell | str] = [f"{name} (not eligible)" if results.status(name) == NOT_ELIGIBLE else name]
        for found in changes.values():
            change, *ends = found.loc[name, ["change", "lower", "upper"]].to_numpy(np.float64).tolist()
            known = all(map(math.isfinite, ends))
            row.append(signed(change))
            row.append(Cell(f"{signed(ends[0]).text} to {signed(ends[1]).text}" if known else "–", "short"))
        rows.append(row)
    titles = [words for aim in changes for words in (f"{AIM_LABELS[aim]} %", "interval")]
    return figures_table(("set", *titles), rows)
