"""Histograms of many figures side by side, as one SVG.

There are dozens of them, each of a few rectangles: written here they take a hundredth of the time that as many axes of
Matplotlib take, which does what is not that simple.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from matplotlib.ticker import MaxNLocator

from fusetune.report.figures.drawing import minus, power_of_ten

BAR_COLOUR = "#56B4E9"
LIMIT_COLOUR = "#CC0000"

_COLUMNS = 3
_PANEL = (335.0, 175.0)
_LEFT, _RIGHT, _TOP, _BOTTOM = 36.0, 16.0, 26.0, 42.0
"""Margins of a panel around its axes, px."""
_HEADROOM = 1.25
_BESIDE = 0.04
"""Of the range of the values, on either side."""
_STYLE = (
    "text{font:10px 'DejaVu Sans',Verdana,sans-serif;fill:#333333}.head{fill:#000000}.note{font-size:9px;fill:#555555}"
    f".bar{{fill:{BAR_COLOUR};stroke:#ffffff;stroke-width:.6}}.usual{{fill:#000000;fill-opacity:.06}}"
    ".grid{stroke:#dddddd;stroke-width:.7}.axis{stroke:#666666}.median{stroke:#222222;stroke-width:1.7}"
    f".limit{{stroke:{LIMIT_COLOUR};stroke-width:1.2;stroke-dasharray:5 2}}"
)


@dataclass(frozen=True)
class HistogramPanel:
    """Counts of the flights by a figure's value.

    Attributes
    ----------
    edges, counts : (B + 1,) and (B,) of the bins
    usual : between which the middle 90 % lie
    limit : None where there is none, or one too far away to be shown
    note : how many flights there are, and how many beyond the bins
    """

    title: str
    edges: Sequence[float]
    counts: Sequence[int]
    usual: tuple[float, float]
    median: float
    limit: float | None
    note: str

    @property
    def reach(self) -> tuple[float, float]:
        """Smallest and largest value shown."""
        shown = [*self.edges, *self.usual, self.median, *([] if self.limit is None else [self.limit])]
        beside = _BESIDE * (max(shown) - min(shown))
        return min(shown) - beside, max(shown) + beside


def histograms_svg(panels: Sequence[HistogramPanel]) -> str:
    """The panels in three columns."""
    width, height = _COLUMNS * _PANEL[0], -(-len(panels) // _COLUMNS) * _PANEL[1]
    places = [(place % _COLUMNS * _PANEL[0], place // _COLUMNS * _PANEL[1]) for place in range(len(panels))]
    drawn = [
        f'<g transform="translate({x + _LEFT:g} {y + _TOP:g})">{"".join(_parts(panel))}</g>'
        for panel, (x, y) in zip(panels, places, strict=True)
    ]
    size = f'width="{width:g}" height="{height:g}" viewBox="0 0 {width:g} {height:g}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size}><style>{_STYLE}</style>'
    return f'{head}<rect width="100%" height="100%" fill="#ffffff"/>{"".join(drawn)}</svg>\n'


def _parts(panel: HistogramPanel) -> Iterator[str]:
    """From what lies beneath to what lies on top; the upper left corner of the axes is at 0, 0."""
    width, height = _PANEL[0] - _LEFT - _RIGHT, _PANEL[1] - _TOP - _BOTTOM
    low, high = panel.reach
    most = _HEADROOM * max(*panel.counts, 1)

    def across(value: float) -> float:
        return width * (value - low) / (high - low)

    def down(count: float) -> float:
        return height * (1.0 - count / most)

    yield _rectangle("usual", across(panel.usual[0]), across(panel.usual[1]), 0.0, height)
    for count in _ticks(0.0, most, 3, integer=True):
        yield _line("grid", 0.0, width, down(count), down(count))
        yield _text("", -5.0, down(count) + 3.5, "end", _number(count))
    for start, stop, count in zip(panel.edges[:-1], panel.edges[1:], panel.counts, strict=True):
        if count:
            yield _rectangle("bar", across(start), across(stop), down(count), height)
    yield _line("axis", 0.0, width, height, height) + _line("axis", 0.0, 0.0, 0.0, height)
    for value in _ticks(low, high, 4):
        yield _line("axis", across(value), across(value), height, height + 4.0)
        yield _text("", across(value), height + 15.0, "middle", _number(value))
    yield _line("median", across(panel.median), across(panel.median), 0.0, height)
    if panel.limit is not None:
        yield _line("limit", across(panel.limit), across(panel.limit), 0.0, height)
    yield _text("head", 0.0, -8.0, "start", panel.title)
    yield _text("note", width - 4.0, 12.0, "end", panel.note)


def _ticks(low: float, high: float, most: int, *, integer: bool = False) -> list[float]:
    found = MaxNLocator(most, integer=integer).tick_values(low, high)
    # without what is left over by adding up steps
    tidy = np.where(np.abs(found) < 1e-9 * (high - low), 0.0, found)
    return [float(f"{one:.10g}") for one in tidy.tolist() if low <= one <= high]


def _number(value: float) -> str:
    digits, is_small, exponent = f"{value:g}".partition("e")
    return minus(digits) + (f"·{power_of_ten(int(exponent))}" if is_small else "")


def _rectangle(kind: str, left: float, right: float, top: float, bottom: float) -> str:
    return f'<rect class="{kind}" x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" height="{bottom - top:.1f}"/>'


def _line(kind: str, x1: float, x2: float, y1: float, y2: float) -> str:
    return f'<line class="{kind}" x1="{x1:.1f}" x2="{x2:.1f}" y1="{y1:.1f}" y2="{y2:.1f}"/>'


def _text(kind: str, x: float, y: float, anchor: str, words: str) -> str:
    named = f' class="{kind}"' if kind else ""
    return f'<text{named} x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(words)}</text>'
