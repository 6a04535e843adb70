"""Axes of a chart: ticks, a pale grid, what they are of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from fusetune.report.charts.svg.elements import group, hinted, line, path_steps, text
from fusetune.report.charts.svg.scales import Log, Scale, figure
from fusetune.report.charts.svg.text_width import BOLDER, FONT_SIZE, ends_fitted, text_width

NARROW, WIDE = 320.0, 720.0
"""Width of a chart on a phone or beside others, and of one that has a page for itself."""
HEAD = 18.0
"""Room for a title above a chart."""
TICK_ROOM, LABEL_ROOM = 17.0, 15.0
"""Room for the figures at the ticks below axes, and for what the axis is of."""
_MARGIN = 8.0
"""Beyond the right end of an axis."""
_BETWEEN = 8.0
"""At least so far apart are the words at two ticks."""

Words = Callable[[float], str]


@dataclass(frozen=True)
class Panel:
    """Axes with their scales; y grows downwards on the page, so that its scale starts at the bottom."""

    x: Scale
    y: Scale

    @property
    def left(self) -> float:
        """Place of the left edge."""
        return self.x.start

    @property
    def right(self) -> float:
        """Place of the right edge."""
        return self.x.stop

    @property
    def top(self) -> float:
        """Place of the upper edge."""
        return min(self.y.start, self.y.stop)

    @property
    def bottom(self) -> float:
        """Place of the lower edge."""
        return max(self.y.start, self.y.stop)


def head(words: str, width: float = NARROW) -> str:
    """Title of a panel; what does not fit stands where the pointer rests."""
    shown = ends_fitted(words, width / BOLDER)
    drawn = text(0.0, 12.0, shown, "head")
    return drawn if shown == words else hinted(words, drawn)


def x_axis(
    panel: Panel, label: str = "", ticks: Sequence[float] | None = None, words: Words = figure, *, grid: bool = True
) -> str:
    """Below a panel: it takes `TICK_ROOM` and, with a label, `LABEL_ROOM`."""
    found = fitting_ticks(panel.x, words) if ticks is None else [one for one in ticks if panel.x.holds(one)]
    places = [panel.x.at(one) for one in found]
    parts = [_rules([(place, panel.top, place, panel.bottom) for place in places])] if grid else []
    parts.append(line(panel.left, panel.bottom, panel.right, panel.bottom, "axis"))
    for place, value in zip(places, found, strict=True):
        parts.append(text(*_inside(place, words(value), panel), words(value), "tick", "middle"))
    if label:
        # under the middle of the axis, as far as it does not run out of the chart
        half, edge = 0.5 * text_width(label), panel.right + _MARGIN
        middle = max(min(0.5 * (panel.left + panel.right), edge - half), half)
        parts.append(text(middle, panel.bottom + 28.0, label, "of", "middle"))
    return "".join(parts)


def _inside(place: float, words: str, panel: Panel) -> tuple[float, float]:
    """Where words at a tick stand, which must not be cut at the right edge of the chart."""
    room = 0.5 * text_width(words)
    return min(place, panel.right + _MARGIN - room), panel.bottom + 13.0


def fitting_ticks(scale: Scale, words: Words = figure) -> list[float]:
    """As many ticks as their words have room for."""
    length = abs(scale.stop - scale.start)
    for most in range(7, 1, -1):
        found = scale.ticks(most)
        widest = max((text_width(words(one)) for one in found), default=0.0)
        places = sorted(scale.at(one) for one in found)
        nearest = min((b - a for a, b in pairwise(places)), default=length)
        if nearest >= widest + _BETWEEN:
            return found
    return scale.ticks(2)


def y_axis(
    panel: Panel, label: str = "", ticks: Sequence[float] | None = None, words: Words = figure, *, most: int = 5
) -> str:
    """At the left of a panel; what it is of stands above it, as nobody reads sideways."""
    room = int(max((panel.bottom - panel.top) / 22.0, 2.0))
    found = panel.y.ticks(min(most, room)) if ticks is None else [one for one in ticks if panel.y.holds(one)]
    places = [panel.y.at(one) for one in found]
    parts = [_rules([(panel.left, place, panel.right, place) for place in places])]
    parts.append(line(panel.left, panel.top, panel.left, panel.bottom, "axis"))
    for place, value in zip(places, found, strict=True):
        parts.append(text(panel.left - 5.0, place + 0.35 * FONT_SIZE, words(value), "tick", "end"))
    if label:
        parts.append(text(0.0, panel.top - 6.0, label, "of"))
    return "".join(parts)


def y_room(scale: Scale, words: Words = figure, most: int = 5) -> float:
    """How much the figures at a y axis take."""
    return 9.0 + max((text_width(words(one)) for one in scale.ticks(most)), default=0.0)


def _rules(ends: Sequence[tuple[float, float, float, float]]) -> str:
    """The grid as one path."""
    steps = "".join(path_steps([x1, x2], [y1, y2]) for x1, y1, x2, y2 in ends)
    return f'<path class="grid" d="{steps}"/>' if steps else ""


def minor_rules(panel: Panel, scale: Log) -> str:
    """Paler lines of a logarithmic x axis between its decades."""
    values = [digit * 10.0**power for power in range(-12, 13) for digit in range(2, 10)]
    places = [scale.at(one) for one in values if scale.holds(one)]
    return group("minor", _rules([(place, panel.top, place, panel.bottom) for place in places]))
