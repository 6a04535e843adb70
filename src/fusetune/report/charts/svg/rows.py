"""Charts of named rows, the first on top."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fusetune.report.charts.svg.axes import NARROW
from fusetune.report.charts.svg.elements import hinted, text
from fusetune.report.charts.svg.text_width import BOLDER, FONT_SIZE, fitted_names, text_width

_GAP = 8.0
_WIDEST = 0.42
"""Share of a chart that names may take."""


@dataclass(frozen=True)
class Rows:
    """Names in a column at the left, and where their rows are.

    Attributes
    ----------
    names : all of them, the first on top
    top : upper edge of the first row
    height : of a row
    room : where the axes begin
    kinds : classes of the names, in their order; empty where they have none
    """

    names: Sequence[str]
    top: float
    height: float
    room: float
    kinds: Sequence[str] = ()

    def y(self, place: float) -> float:
        """Middle of a row, or a place between rows."""
        return self.top + (place + 0.5) * self.height

    @property
    def bottom(self) -> float:
        """Lower edge of the last row."""
        return self.top + len(self.names) * self.height

    def labels(self) -> str:
        """The names, those that had to be shortened with all of them where the pointer rests."""
        parts = []
        short = fitted_names(tuple(self.names), (self.room - _GAP) / BOLDER)
        for place, (name, shown) in enumerate(zip(self.names, short, strict=True)):
            kind = self.kinds[place] if self.kinds else ""
            words = text(self.room - _GAP, self.y(place) + 0.35 * FONT_SIZE, shown, kind, "end")
            parts.append(words if shown == name else hinted(name, words))
        return "".join(parts)


def rows_of(names: Sequence[str], top: float, height: float, width: float = NARROW, kinds: Sequence[str] = ()) -> Rows:
    """Rows with as much room for their names as they need, and less than half of the chart."""
    widest = max((text_width(name) for name in names), default=0.0)
    return Rows(names, top, height, min(BOLDER * widest + _GAP, _WIDEST * width), kinds)
