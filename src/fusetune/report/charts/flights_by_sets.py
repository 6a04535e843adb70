"""On each flight, how much larger or smaller a set's prediction error is than the present set's."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from fusetune.report.charts.blocks import chart_block, in_a_box
from fusetune.report.charts.set_looks import set_class, set_marker
from fusetune.report.charts.svg.axes import NARROW
from fusetune.report.charts.svg.elements import group, hinted, rectangle, svg, text
from fusetune.report.charts.svg.rows import rows_of
from fusetune.report.charts.svg.scales import minus
from fusetune.report.charts.svg.text_width import FONT_SIZE, fitted_names, text_width
from fusetune.report.comparison import flight_changes
from fusetune.report.results import Results
from fusetune.report.short_names import flight_labels

Array = npt.NDArray[np.float64]

_ROW, _COLUMN = 21.0, 42.0
_WIDEST_NAME = 150.0
_STEPS = 8
"""Of the colour, from none to full."""
_DARKEST = 0.62
_SLANT = 45.0
_TITLE = "Change of the prediction error on each flight, percent of what flies now; below 0 is better"


def flights_by_sets_chart(results: Results) -> str:
    """A cell for each flight and set, the darker the larger the change; empty where nothing was compared.

    The sign stands in each cell, so that it does not hang on the colour.
    """
    changes = flight_changes(results)
    if changes.empty or not len(changes.columns):
        return ""
    values = changes.to_numpy(np.float64)
    flights, sets = [str(one) for one in changes.index], [str(one) for one in changes.columns]
    chart = _chart(results, values, flights, sets)
    return chart_block(_TITLE, [in_a_box(chart, "The table of flights and sets moves sideways.")])


def _chart(results: Results, values: Array, flights: list[str], sets: list[str]) -> str:
    short = fitted_names(sets, _WIDEST_NAME)
    lean = math.sin(math.radians(_SLANT))
    head_room = 26.0 + lean * max(text_width(name) for name in short)
    rows = rows_of(flight_labels(flights), head_room, _ROW, 1.2 * NARROW)
    reach = colour_reach(values)
    parts = [rows.labels()]
    for column, name in enumerate(sets):
        x = rows.room + _COLUMN * (column + 0.5)
        parts.append(group(set_class(results, name), set_marker(results, name, x, head_room - 9.0)))
        y = head_room - 18.0
        turned = f' transform="rotate(-{_SLANT:g} {x:.1f} {y:.1f})"'
        words = text(x, y, short[column], "", "start", turned)
        parts.append(words if short[column] == name else hinted(name, words))
    for (row, column), value in np.ndenumerate(values):
        left, top = rows.room + _COLUMN * column, rows.y(row) - 0.5 * _ROW
        hint = f"{sets[column]} on {flights[row]}: {_in_words(value)}"
        cell = rectangle(left + 1.0, top + 1.0, left + _COLUMN - 1.0, top + _ROW - 1.0, *_look(value, reach))
        figure = text(left + 0.5 * _COLUMN, top + 0.5 * _ROW + 0.35 * FONT_SIZE, cell_words(value), "", "middle")
        parts.append(hinted(hint, cell, figure))
    last = lean * text_width(short[-1]) - 0.5 * _COLUMN
    width = rows.room + _COLUMN * len(sets) + max(last, 0.0) + 6.0
    better = int(np.count_nonzero(values < 0.0)), int(np.count_nonzero(values > 0.0))
    said = f"{len(flights)} flights by {len(sets)} sets: {better[0]} smaller than now, {better[1]} larger."
    drawn = svg("flights-by-sets", _TITLE, said, width, rows.bottom + 4.0, parts, "is-natural")
    # as wide as it is, whatever the page's width: the box around it scrolls
    return drawn.replace("<svg ", f'<svg width="{width:.0f}" height="{rows.bottom + 4.0:.0f}" ', 1)


def colour_reach(values: Array) -> float:
    """Where the colour is full: a hopeless set takes the end of the scale and leaves the others theirs, percent."""
    typical = np.nanmedian(np.abs(values), axis=0)
    shown = np.abs(values)[:, typical <= 3.0 * max(float(np.nanmedian(typical)), 0.3)]
    return max(float(np.nanquantile(shown, 0.9)), 1.0)


def _look(value: float, reach: float) -> tuple[str, str]:
    """Class of a cell and how dark it is."""
    if not math.isfinite(value) or value == 0.0:
        return "cell", ""
    step = min(max(math.ceil(_STEPS * abs(value) / reach), 1), _STEPS)
    return f"cell {'good' if value < 0.0 else 'bad'}", f' fill-opacity="{_DARKEST * step / _STEPS:.2f}"'


def cell_words(value: float) -> str:
    """A change in few signs: "–" where it is not known, "=" where there is none."""
    if math.isnan(value):
        return "–"
    if value == 0.0:
        return "="
    if abs(value) >= 999.5:
        return "≫" if value > 0.0 else "≪"
    return minus(f"{value:+.0f}" if abs(value) >= 9.5 else f"{value:+.1f}")


def _in_words(value: float) -> str:
    if math.isnan(value):
        return "not scored"
    if value == 0.0:
        return "as now"
    return minus(f"{value:+.1f} % {'(better)' if value < 0.0 else '(worse)'}")
