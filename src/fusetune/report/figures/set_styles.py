"""How a set looks in every figure: by its part in the decision, or by a colour and marker of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fusetune.report.figures.drawing import CANDIDATE_COLOUR, CHOSEN_COLOUR, PRESENT_COLOUR, VETOED_COLOUR
from fusetune.report.results import Results

PRINT_COLOURS = ("#17202a", "#0072b2", "#d55e00", "#009e73", "#b85a8d", "#c27c00", "#2f8fc9", "#8f8300")
"""Of Okabe and Ito, dark enough for paper, by the number that a set's look has (`fusetune.report.set_styles`)."""

MATPLOTLIB_MARKERS: Mapping[str, str] = {
    "circle": "o",
    "square": "s",
    "diamond": "D",
    "triangle": "^",
    "down": "v",
    "plus": "P",
    "cross": "X",
    "star": "*",
}


@dataclass(frozen=True)
class SetStyle:
    """Colour, marker and weight of a set's curve."""

    colour: str
    marker: str
    width: float


def status_colour(results: Results, name: str) -> str:
    """Black for the present set, blue for the chosen one, grey for those that are not eligible."""
    if name == results.present:
        return PRESENT_COLOUR
    if name == results.decision["chosen"]:
        return CHOSEN_COLOUR
    return VETOED_COLOUR if results.is_ruled_out(name) else CANDIDATE_COLOUR


def set_styles(results: Results) -> dict[str, SetStyle]:
    """The look of each shown set, the same as on the pages."""
    widths = {results.decision["chosen"]: 2.0} | {results.present: 2.4}
    return {
        name: SetStyle(
            PRINT_COLOURS[results.styles[name].index],
            MATPLOTLIB_MARKERS[results.styles[name].marker],
            widths.get(name, 1.1),
        )
        for name in results.shown
    }
