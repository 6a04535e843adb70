"""Figures as journals want them: as wide as a column, in 8 points, as vectors, the same bytes every time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec

from fusetune.report.figures.drawing import figure_style
from fusetune.storage.files import AnyPath, atomic_path

COLUMNS = {"single": 85.0, "double": 178.0}
"""Width of a figure, mm."""
FORMATS = ("svg", "pdf", "png")
INCH_MM = 25.4

_DPI = 300
_WIDEST_MARGIN = 0.6
"""Share of a figure."""
_STYLE: dict[Any, Any] = {
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "lines.linewidth": 0.9,
    "axes.linewidth": 0.6,
    "pdf.fonttype": 42,
}
_NOTHING: dict[str, dict[str, Any]] = {
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    "png": {"Software": None},
}
"""Of the time and the program nothing is written."""


@contextmanager
def publication_style() -> Iterator[None]:
    """Everything drawn inside has the report's style in the sizes of print."""
    with figure_style(), matplotlib.rc_context(_STYLE):
        yield


def fitted_to_column(figure: Figure, width_mm: float) -> Figure:
    """A figure made no wider than a column, as high as it was; margins that are not sought keep their width."""
    width, height = (float(one) for one in figure.get_size_inches())
    narrower = width_mm / INCH_MM
    if width <= narrower:
        return figure
    figure.set_size_inches(narrower, height)
    if figure.get_layout_engine() is None and not _keep_margins(figure, width / narrower):
        figure.set_layout_engine("constrained")
    return figure


def _keep_margins(figure: Figure, ratio: float) -> bool:
    """Whether a figure has margins of its own; they are as wide in inches as when it was so many times as wide."""
    places = [(axes, place) for axes in figure.axes if (place := axes.get_subplotspec()) is not None]
    grids = {id(grid): grid for _, place in places if (grid := place.get_topmost_subplotspec().get_gridspec())}
    reckoned = [one for one in grids.values() if isinstance(one, GridSpec) and one.left is not None]
    for one in reckoned:
        margins = one.get_subplot_params(figure)
        one.update(left=min(margins.left * ratio, _WIDEST_MARGIN), right=1.0 - (1.0 - margins.right) * ratio)
    for axes, place in places if reckoned else ():
        axes.set_position(place.get_position(figure))
    return bool(reckoned)


def save_figure(figure: Figure, path: AnyPath) -> None:
    """Write a figure in the format that the file's name ends with."""
    kind = Path(path).suffix[1:]
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format=kind, dpi=_DPI, metadata=_NOTHING[kind])


def save_pages(figures: Sequence[Figure], path: AnyPath) -> None:
    """Write figures as the pages of one PDF."""
    with atomic_path(path) as temporary, PdfPages(temporary, metadata=_NOTHING["pdf"]) as pages:
        for one in figures:
            pages.savefig(one)
