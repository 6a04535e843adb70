"""Legends: what a colour and a shape stand for, in as many lines as they need."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from fusetune.report.charts.svg.axes import NARROW
from fusetune.report.charts.svg.elements import group, line, rectangle, text
from fusetune.report.charts.svg.markers import marker
from fusetune.report.charts.svg.text_width import fitted, text_width

LINE = 16.0
_SYMBOL = 18.0
_BETWEEN = 12.0

Symbol = Callable[[float, float], str]
"""Draws what an entry is of around a point."""


class Entry(NamedTuple):
    """A line of a legend."""

    symbol: Symbol
    words: str


def legend(entries: Sequence[Entry], top: float, width: float = NARROW) -> tuple[str, float]:
    """Entries beside one another, and below where the line is full.

    Parameters
    ----------
    top : place of its upper edge
    width : of the chart

    Returns
    -------
    The drawing and its height.
    """
    parts, x, row = [], 0.0, 0
    for entry in entries:
        words = fitted(entry.words, width - _SYMBOL)
        taken = _SYMBOL + text_width(words)
        if x > 0.0 and x + taken > width:
            x, row = 0.0, row + 1
        y = top + LINE * (row + 0.5)
        parts += [entry.symbol(x + 0.4 * _SYMBOL, y), text(x + _SYMBOL, y + 4.0, words)]
        x += taken + _BETWEEN
    return "".join(parts), LINE * (row + 1) if entries else 0.0


def marker_symbol(kind: str, shape: str, *, hollow: bool = False, through: str = "") -> Symbol:
    """A marker, on a piece of line of a class where that is given."""

    def draw(x: float, y: float) -> str:
        below = line(x - 7.0, y, x + 7.0, y, through) if through else ""
        return group(kind, below, marker(shape, x, y, 4.0, hollow=hollow))

    return draw


def line_symbol(kind: str, of_line: str = "line") -> Symbol:
    """A piece of line."""
    return lambda x, y: group(kind, line(x - 7.0, y, x + 7.0, y, of_line))


def patch_symbol(kind: str, of_patch: str = "band") -> Symbol:
    """A patch of a colour."""
    return lambda x, y: group(kind, rectangle(x - 6.0, y - 4.5, x + 6.0, y + 4.5, of_patch))


def dot_symbol(kind: str) -> Symbol:
    """One of many dots, of which those that lie on others are darker."""
    return lambda x, y: group(kind, f'<circle class="dot" cx="{x:.1f}" cy="{y:.1f}" r="3.2"/>')
