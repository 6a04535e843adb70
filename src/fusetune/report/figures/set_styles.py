"""How a set looks in every figure: by its part in the decision, or by a colour and marker of its own."""

from dataclasses import dataclass

from fusetune.report.figures.drawing import CANDIDATE_COLOUR, CHOSEN_COLOUR, PRESENT_COLOUR, VETOED_COLOUR, set_colours
from fusetune.report.results import Results

_MARKERS = "osD^vP*X"


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
    """A look for each shown set that it keeps in all figures; colours come again with another marker."""
    colours = set_colours(results.shown, results.present)
    styles = {results.present: SetStyle(PRESENT_COLOUR, "o", 2.4)}
    for index, name in enumerate((name for name in results.shown if name != results.present), start=1):
        width = 2.0 if name == results.decision["chosen"] else 1.1
        styles[name] = SetStyle(colours[name], _MARKERS[index % len(_MARKERS)], width)
    return styles
