"""Drawing without a display: the style, colours of the sets, and files that are the same bytes every time."""

import gc
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, Literal

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from matplotlib.transforms import ScaledTranslation
from PIL import Image

from fusetune.storage.files import AnyPath, atomic_path

STYLE = Path(__file__).with_name("figures.mplstyle")

PRESENT_COLOUR = "#222222"
CHOSEN_COLOUR = "#0072B2"
CANDIDATE_COLOUR = "#56B4E9"
VETOED_COLOUR = "#B0B0B0"
GOOD_COLOUR, BAD_COLOUR = "#009E73", "#D55E00"

_PNG_COLOURS = 96
_PNG_COMPRESSION = 6
"""Of zlib; the highest, 9, takes eight times as long for a tenth of the size."""
_PANEL_COLUMNS = 3
_OBJECTS_OF_A_FIGURE = 50_000
_PIXELS_OF_A_LINE = 1000
_SEEN_OF_A_PIXEL = 4
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@contextmanager
def figure_style() -> Iterator[None]:
    """Everything drawn inside has the report's style.

    Garbage is collected about once a figure: after every 700 new objects, as is usual, Python would look through the
    parts of a figure hundreds of times while it grows.
    """
    threshold = gc.get_threshold()
    if threshold[0]:
        gc.set_threshold(max(_OBJECTS_OF_A_FIGURE, threshold[0]), *threshold[1:])
    try:
        with matplotlib.rc_context(_style()):
            yield
    finally:
        gc.set_threshold(*threshold)


@cache
def _style() -> matplotlib.RcParams:
    return matplotlib.rc_params_from_file(STYLE, use_default_template=False)


def new_figure(width: float, height: float, layout: Literal["constrained"] | None = "constrained") -> Figure:
    """An empty figure of a size in inches, drawn by Agg, with room made for its labels.

    With `layout=None` the caller places the axes; finding the room takes longer than drawing a figure.
    """
    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def save_svg(figure: Figure, path: AnyPath) -> None:
    """Write an SVG without date or random names."""
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format="svg", metadata={"Date": None, "Creator": None})


def save_png(figure: Figure, path: AnyPath) -> None:
    """Write a PNG with a small palette: a third of the size of full colour, and no difference to see in a plot."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())[:, :, :3])
    with atomic_path(path) as temporary:
        image.quantize(_PNG_COLOURS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).save(
            temporary, format="PNG", compress_level=_PNG_COMPRESSION
        )


def set_colours(sets: Sequence[str], present: str) -> dict[str, str]:
    """A colour per set: black for the present one, the cycle for the others."""
    cycle = [entry["color"] for entry in matplotlib.rcParams["axes.prop_cycle"] if entry["color"] != "#000000"]
    others = [name for name in sets if name != present]
    colours = {name: _hex(cycle[i % len(cycle)]) for i, name in enumerate(others)}
    colours[present] = PRESENT_COLOUR
    return colours


def _hex(colour: str) -> str:
    return colour if colour.startswith("#") else f"#{colour}"


def empty_figure(message: str) -> Figure:
    """A figure that says why there is nothing to see."""
    figure = new_figure(7.0, 1.2)
    axes = figure.add_subplot()
    axes.set_axis_off()
    axes.text(0.5, 0.5, message, ha="center", va="center", color="#666666", transform=axes.transAxes)
    return figure


def panel_grid(panels: int, names: Sequence[str], row_height: float, title: str) -> tuple[Figure, list[Axes]]:
    """Panels in three columns, one row per name in each, with the names at the left edge only.

    Parameters
    ----------
    names : sets, the first on top
    row_height : height of a name's row, inch

    Returns
    -------
    The figure and its `panels` axes. Margins are reckoned from the names, not sought: that is three times as fast.
    """
    columns = min(_PANEL_COLUMNS, panels)
    rows = -(-panels // columns)
    left = 0.25 + 0.068 * max(len(name) for name in names)
    panel_height, gap, head = row_height * (len(names) + 0.3), 0.72, 0.62
    width, height = left + columns * 2.3 + 0.1, head + rows * (panel_height + gap) - 0.2
    figure = new_figure(width, height, layout=None)
    grid = figure.subplots(
        rows,
        columns,
        squeeze=False,
        gridspec_kw={
            "left": left / width,
            "right": 1.0 - 0.1 / width,
            "top": 1.0 - head / height,
            "bottom": (gap - 0.2) / height,
            "hspace": gap / panel_height,
            "wspace": 0.1,
        },
    )
    for index, axes in enumerate(grid.flat):
        axes.set_visible(index < panels)
        label_sets(axes, names, is_named=index % columns == 0)
    figure.text(0.1 / width, 1.0 - 0.1 / height, title, ha="left", va="top", fontsize=9.5)
    return figure, list(grid.flat)[:panels]


def label_sets(axes: Axes, sets: Sequence[str], *, is_named: bool = True) -> None:
    """One row per set, the first on top."""
    if is_named:
        axes.set_yticks(range(len(sets)), sets)
    else:
        axes.set_yticks([])
    axes.set_ylim(len(sets) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")


def minus(text: str) -> str:
    """With the typographical sign."""
    return text.replace("-", "−")


def drawn_rows(values: npt.NDArray[Any]) -> npt.NDArray[np.intp]:
    """Rows of a long line that can be seen: of each pixel's the first, the last, the lowest and the highest.

    Parameters
    ----------
    values : (N,), in the order in which they are drawn
    """
    together = -(-values.size // _PIXELS_OF_A_LINE)
    if together <= _SEEN_OF_A_PIXEL:
        return np.arange(values.size)
    padded = np.pad(values.astype(np.float64), (0, -values.size % together), mode="edge").reshape(-1, together)
    unknown = np.isnan(padded)
    lowest = np.where(unknown, np.inf, padded).argmin(axis=1)
    highest = np.where(unknown, -np.inf, padded).argmax(axis=1)
    inside = np.stack([np.zeros_like(lowest), lowest, highest, np.full_like(lowest, together - 1)])
    rows = inside + np.arange(len(padded)) * together
    return np.unique(np.minimum(rows, values.size - 1))


def decades(axes: Axes) -> None:
    """A logarithmic scale with powers of ten alone, written without Matplotlib's formulas, which take long."""
    axes.set_yscale("log")
    axes.minorticks_off()
    axes.yaxis.set_major_formatter(FuncFormatter(_power_of_ten))


def _power_of_ten(value: float, _: int | None = None) -> str:
    exponent = round(math.log10(value))
    return power_of_ten(exponent) if math.isclose(value, 10.0**exponent) else f"{value:g}"


def power_of_ten(exponent: int) -> str:
    """As it is printed."""
    return "10" + str(exponent).translate(_RAISED)


def set_title(axes: Axes, words: str) -> None:
    """The title of axes on top of which nothing stands, so that none of it has to be measured to find a place above."""
    axes.set_title(words, y=1.0)


def label_margins(axes: Axes, left: float = 0.47, below: float = 0.3) -> None:
    """Axis labels at distances in inches from the axes: in one line over panels, and nothing has to be measured."""
    inches = axes.figure.dpi_scale_trans
    axes.yaxis.set_label_coords(0.0, 0.5, axes.transAxes + ScaledTranslation(-left, 0.0, inches))
    axes.xaxis.set_label_coords(0.5, 0.0, axes.transAxes + ScaledTranslation(0.0, -below, inches))
