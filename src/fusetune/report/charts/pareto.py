"""Accuracy with all sensors and drift without GNSS at once, of the sets compared and of those that a search tried."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pandas as pd

from fusetune.apply.evidence import AIDED, SMOOTHED, UNAIDED
from fusetune.apply.pareto import pareto_front, two_aims
from fusetune.apply.trials import Trials
from fusetune.report.charts.blocks import chart_block, figures_table
from fusetune.report.charts.set_looks import set_entries, set_group, set_marker
from fusetune.report.charts.svg.axes import LABEL_ROOM, NARROW, TICK_ROOM, Panel, x_axis, y_axis, y_room
from fusetune.report.charts.svg.elements import crosses, dots, group, hinted, line, path, rectangle, svg, text
from fusetune.report.charts.svg.legend import Entry, dot_symbol, legend, line_symbol, marker_symbol
from fusetune.report.charts.svg.markers import marker
from fusetune.report.charts.svg.scales import Linear, percent, signed_figure
from fusetune.report.comparison import aim_changes, known_ends, percent_change, robust_reach
from fusetune.report.markup import Cell, signed
from fusetune.report.results import OUT, Results

Array = npt.NDArray[np.float64]
Limits = tuple[float, float]

_TOP, _SIZE = 22.0, 250.0
_TITLE = "Two aims against what flies now: left and down is better"
_UNAIDED = "drift after seconds without GNSS [%]"
_AIDED = "errors one step ahead [%]"
_ACCURACY = {AIDED: _AIDED, SMOOTHED: "errors of the smoothed velocity [%]"}
_MIXED = "errors one step ahead, or of the velocity [%]"
_SHOWN_SHARE = 0.6
_LEAST_REACH = 2.0
_MOST_CELLS = 60
"""Along each axis: of many sets that lie on each other one is drawn."""


def pareto_chart(results: Results) -> str:
    """Error one step ahead and without GNSS of each shown set, with intervals, and the front of those that can be
    chosen; empty where no flight tells of both."""
    aided, unaided = aim_changes(results, AIDED), aim_changes(results, UNAIDED)
    both = aided.add_suffix("_aided").join(unaided.add_suffix("_unaided"), how="inner")
    both = both[both.index.isin(results.shown)]
    if both.empty:
        return ""
    able = (~both["status_aided"].isin(OUT)).to_numpy()
    x_limits = robust_reach(*known_ends(both, "_aided"), able)
    y_limits = robust_reach(*known_ends(both, "_unaided"), able)
    panel = _panel(x_limits, y_limits)
    parts = [*_ground(panel, _AIDED)]
    places = [(0.0, 0.0), *zip(both.loc[able, "change_aided"], both.loc[able, "change_unaided"], strict=True)]
    parts.append(_stairs(panel, np.array(places, np.float64)))
    said = []
    for name, one in both.iterrows():
        hint = f"{name}: {percent(one['change_aided'])} one step ahead, {percent(one['change_unaided'])} without GNSS"
        said.append(hint)
        parts.append(_cross(results, str(name), one, panel, hint))
    parts.append(set_group(results, results.present, f"{results.present}: flies now",
                           set_marker(results, results.present, panel.x.at(0.0), panel.y.at(0.0), 5.0)))  # fmt: skip
    front = Entry(line_symbol("good", "dashed"), "no set is better in both")
    entries = [*set_entries(results, [results.present, *map(str, both.index)]), front]
    return chart_block(_TITLE, [_finished(panel, parts, entries, _TITLE, ". ".join(said))], _table(results, both))


def _panel(x_limits: Limits, y_limits: Limits) -> Panel:
    y = Linear(*y_limits, _TOP + _SIZE, _TOP)
    return Panel(Linear(*x_limits, y_room(y, signed_figure), NARROW - 10.0), y)


def _ground(panel: Panel, accuracy: str) -> list[str]:
    """The quarter that is better in both, zero lines and axes."""
    x0, y0 = panel.x.at(0.0), panel.y.at(0.0)
    return [
        rectangle(panel.left, y0, x0, panel.bottom, "better"),
        x_axis(panel, f"{accuracy}", words=signed_figure),
        y_axis(panel, _UNAIDED, words=signed_figure),
        line(panel.left, y0, panel.right, y0, "axis"),
        line(x0, panel.top, x0, panel.bottom, "axis"),
        text(panel.left + 5.0, panel.bottom - 6.0, "better in both", "good over"),
    ]


def _stairs(panel: Panel, places: Array) -> str:
    """Through what nothing beats in both aims, from the upper left to the lower right."""
    front = sorted({(float(x), float(y)) for x, y in places[pareto_front(places)]})
    x = [front[0][0], *(one for place in front for one in (place[0], place[0])), panel.x.high]
    y = [panel.y.high, *(one for before, after in zip([(0.0, panel.y.high), *front], front, strict=False)
                         for one in (before[1], after[1])), front[-1][1]]  # fmt: skip
    across = np.clip(panel.x(x), panel.left, panel.right)
    down = np.clip(panel.y(y), panel.top, panel.bottom)
    return group("good", path(across, down, "dashed"))


def _cross(results: Results, name: str, one: pd.Series, panel: Panel, hint: str) -> str:
    x, y = (float(np.clip(one[column], scale.low, scale.high)) for column, scale in
            (("change_aided", panel.x), ("change_unaided", panel.y)))  # fmt: skip
    parts = []
    for suffix, scale in (("aided", panel.x), ("unaided", panel.y)):
        ends = [float(np.clip(one[f"{end}_{suffix}"], scale.low, scale.high)) for end in ("lower", "upper")]
        if all(map(math.isfinite, ends)):
            low, high = map(scale.at, ends)
            is_across = scale is panel.x
            beside = panel.y.at(y) if is_across else panel.x.at(x)
            parts.append(line(*((low, beside, high, beside) if is_across else (beside, low, beside, high)), "thin"))
    return set_group(results, name, hint, *parts, set_marker(results, name, panel.x.at(x), panel.y.at(y), 4.5))


def _finished(panel: Panel, parts: list[str], entries: list[Entry], title: str, said: str) -> str:
    below = panel.bottom + TICK_ROOM + LABEL_ROOM + 4.0
    drawn, height = legend(entries, below)
    return svg("pareto", title, said, NARROW, below + height, [*parts, drawn], "")


def _table(results: Results, both: pd.DataFrame) -> str:
    rows: list[list[Cell | str]] = []
    for name, one in both.iterrows():
        row: list[Cell | str] = [str(name)]
        for aim in ("aided", "unaided"):
            row += [signed(float(one[f"{column}_{aim}"])) for column in ("change", "lower", "upper")]
        rows.append(row)
    head = ("set", "one step ahead %", "from", "to", "without GNSS %", "from", "to")
    return figures_table(head, rows)


def search_pareto_chart(trials: Trials | None, chosen: str | None = None, label: str = "chosen") -> str:
    """All sets that were tried: the front of those that may be flown, what flies now, and the chosen one.

    Parameters
    ----------
    chosen : name of the set that is chosen; None, or a name that was not tried, marks none
    label : what it is called
    """
    if trials is None:
        return ""
    differences, accuracy = two_aims(trials)
    changes = percent_change(differences)
    known = np.asarray(np.isfinite(changes).all(axis=1))
    if not known.any():
        return ""
    able = known & trials.allowed.all(axis=1)
    places = np.vstack([changes[able], np.zeros((1, 2))])
    on_front = pareto_front(places)
    front = places[on_front]
    panel = _panel(_reach(changes[known, 0], front[:, 0]), _reach(changes[known, 1], front[:, 1]))
    parts = _ground(panel, _ACCURACY.get(accuracy, _MIXED))
    parts.append(group("quiet", _cloud(panel, changes[known & ~able], cross=True)))
    parts.append(group("quiet", _cloud(panel, places[:-1][~on_front[:-1]], cross=False)))
    parts.append(_stairs(panel, places))
    for x, y in np.unique(front, axis=0).tolist():
        if panel.x.holds(x) and panel.y.holds(y):
            parts.append(group("good", _hinted_place(panel, "circle", x, y, 3.2, "not beaten in both")))
    parts.append(group("set-0", _hinted_place(panel, "square", 0.0, 0.0, 5.0, "flies now")))
    entries = [
        Entry(marker_symbol("set-0", "square"), "flies now"),
        Entry(marker_symbol("good", "circle", through="dashed"), "beaten by none in both"),
        Entry(dot_symbol("quiet"), "beaten"),
    ]
    if (known & ~able).any():
        entries.append(Entry(marker_symbol("quiet", "cross"), "ruled out"))
    if chosen in trials.names and known[trials.names.index(chosen)]:
        x, y = changes[trials.names.index(chosen)].tolist()
        x, y = float(np.clip(x, panel.x.low, panel.x.high)), float(np.clip(y, panel.y.low, panel.y.high))
        parts.append(group("set-1", _hinted_place(panel, "diamond", x, y, 5.5, label)))
        entries.insert(1, Entry(marker_symbol("set-1", "diamond"), label))
    title = _search_title(front)
    return chart_block(title, [_finished(panel, parts, entries, title, f"{known.sum()} sets were tried.")])


def _hinted_place(panel: Panel, shape: str, x: float, y: float, radius: float, words: str) -> str:
    hint = f"{words}: {percent(x)}, {percent(y)} without GNSS"
    return hinted(hint, marker(shape, panel.x.at(x), panel.y.at(y), radius))


def _cloud(panel: Panel, places: Array, *, cross: bool) -> str:
    """Dots or crosses of what lies in the picture."""
    inside = [(x, y) for x, y in places.tolist() if panel.x.holds(x) and panel.y.holds(y)]
    # of those that would lie on each other one is drawn
    step = _SIZE / _MOST_CELLS
    drawn = step * np.round(np.array([(panel.x.at(x), panel.y.at(y)) for x, y in inside]).reshape(-1, 2) / step)
    return crosses(drawn[:, 0], drawn[:, 1], 2.0, "thin") if cross else dots(drawn[:, 0], drawn[:, 1], 1.6, "dot")


def _search_title(front: Array) -> str:
    """The answer first: whether any set is better in both, and by how much."""
    better = front[np.all(front < 0.0, axis=1)]
    if not len(better):
        return "No set is better than now both with all sensors and without GNSS"
    best = better[np.argmin(better.max(axis=1))]
    accuracy, drift = (percent(value, 0) for value in best)
    return f"Two aims: a set changes the errors with all sensors by {accuracy} and the drift without GNSS by {drift}"


def _reach(values: Array, front: Array) -> Limits:
    """Limits that hold the front, the present set and most of the others, not the hopeless ones."""
    best = min(float(front.min()), -_LEAST_REACH)
    worst = max(float(np.quantile(values, _SHOWN_SHARE)), float(front.max()), _LEAST_REACH)
    margin = 0.07 * (worst - best)
    return best - margin, worst + margin
