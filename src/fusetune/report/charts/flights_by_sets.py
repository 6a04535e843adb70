"""On each flight, how much larger or smaller a set's prediction error is than the present set's."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from fusetune.report.change_cells import cell_words, colour_reach
from fusetune.report.charts.blocks import chart_block, in_a_box
from fusetune.report.charts.set_looks import set_class, set_marker
from fusetune.report.charts.svg.axes import NARROW
from fusetune.report.charts.svg.elements import group, hinted, px, svg, text, title
from fusetune.report.charts.svg.rows import Rows, rows_of
from fusetune.report.charts.svg.scales import minus
from fusetune.report.charts.svg.text_width import FONT_SIZE, fitted_names, text_width
from fusetune.report.comparison import flight_changes
from fusetune.report.flight_names import short_names
from fusetune.report.results import Results

Array = npt.NDArray[np.float64]

_ROW, _COLUMN = 21.0, 42.0
_WIDEST_NAME = 150.0
_STEPS = 8
"""Of the colour, from none to full."""
_DARKEST = 0.62
_SLANT = 45.0
_TITLE = "Change of the prediction error on each flight, percent of what flies now; below 0 is better"


def flights_by_sets_chart(results: Results) -> str:
    """A cell for each flight, in the order of the results, and set; empty where nothing was compared.

    The darker, the larger the change. The sign stands in each cell, so that it does not hang on the colour.
    """
    changes = flight_changes(results)
    if changes.empty or not len(changes.columns):
        return ""
    changes = changes.loc[[name for name in results.flights if name in changes.index]]
    values = changes.to_numpy(np.float64)
    flights, sets = [str(one) for one in changes.index], [str(one) for one in changes.columns]
    chart = _chart(results, values, flights, sets)
    return chart_block(_TITLE, [in_a_box(chart, "The table of flights and sets moves sideways.")])


def _chart(results: Results, values: Array, flights: list[str], sets: list[str]) -> str:
    short, names = fitted_names(tuple(sets), _WIDEST_NAME), short_names(results.scoring)
    lean = math.sin(math.radians(_SLANT))
    head_room = 26.0 + lean * max(text_width(name) for name in short)
    rows = rows_of([names[one] for one in flights], head_room, _ROW, 1.2 * NARROW)
    reach = colour_reach(values)
    parts = [rows.labels()]
    for column, name in enumerate(sets):
        x = rows.room + _COLUMN * (column + 0.5)
        parts.append(group(set_class(results, name), set_marker(results, name, x, head_room - 9.0)))
        y = head_room - 18.0
        turned = f' transform="rotate(-{_SLANT:g} {x:.1f} {y:.1f})"'
        words = text(x, y, short[column], "", "start", turned)
        parts.append(words if short[column] == name else hinted(name, words))
    parts.append(_cells(values, reach, rows, flights, sets))
    last = lean * text_width(short[-1]) - 0.5 * _COLUMN
    width = rows.room + _COLUMN * len(sets) + max(last, 0.0) + 6.0
    better = int(np.count_nonzero(values < 0.0)), int(np.count_nonzero(values > 0.0))
    said = f"{len(flights)} flights by {len(sets)} sets: {better[0]} smaller than now, {better[1]} larger."
    drawn = svg("flights-by-sets", _TITLE, said, width, rows.bottom + 4.0, parts, "is-natural")
    # as wide as it is, whatever the page's width: the box around it scrolls
    return drawn.replace("<svg ", f'<svg width="{width:.0f}" height="{rows.bottom + 4.0:.0f}" ', 1)


def _cells(values: Array, reach: float, rows: Rows, flights: list[str], sets: list[str]) -> str:
    """Cells of one colour as one path, and on each its figure, which tells more where the pointer rests."""
    cells: dict[tuple[str, int], list[str]] = {}
    figures = []
    for (row, column), value in np.ndenumerate(values):
        x, y = rows.room + _COLUMN * column, rows.y(row)
        place = f"M{px(x + 1.0)} {px(y - 0.5 * _ROW + 1.0)}h{px(_COLUMN - 2.0)}v{px(_ROW - 2.0)}h{px(2.0 - _COLUMN)}z"
        cells.setdefault(_look(value, reach), []).append(place)
        hint = title(f"{sets[column]} on {flights[row]}: {_in_words(value)}")
        middle = f'x="{px(x + 0.5 * _COLUMN)}" y="{px(y + 0.35 * FONT_SIZE)}"'
        figures.append(f"<text {middle}>{cell_words(value)}{hint}</text>")
    painted = [
        f'<path class="{kind}" d="{"".join(places)}"'
        + (f' fill-opacity="{_DARKEST * step / _STEPS:.2f}"/>' if step else "/>")
        for (kind, step), places in sorted(cells.items())
    ]
    return "".join(painted) + group("middle", *figures)


def _look(value: float, reach: float) -> tuple[str, int]:
    """Class of a cell and how dark it is, in steps."""
    if not math.isfinite(value) or value == 0.0:
        return "cell", 0
    step = min(max(math.ceil(_STEPS * abs(value) / reach), 1), _STEPS)
    return f"cell {'good' if value < 0.0 else 'bad'}", step


def _in_words(value: float) -> str:
    if math.isnan(value):
        return "not scored"
    if value == 0.0:
        return "as now"
    return minus(f"{value:+.1f} % {'(better)' if value < 0.0 else '(worse)'}")
