"""How a set looks wherever it is shown: a colour and a marker of its own, from its name."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from zlib import crc32

PRESENT_INDEX, CHOSEN_INDEX = 0, 1
"""Colours that no other set has: black or white for what flies now, blue for what is chosen."""
COLOURS = 8
"""Of the style sheet, `--set-0` to `--set-7`."""
MARKERS = ("circle", "square", "diamond", "triangle", "down", "plus", "cross", "star")
"""The first is what flies now."""

_FREE_COLOURS = range(CHOSEN_INDEX + 1, COLOURS)
_FREE_MARKERS = MARKERS[1:]


@dataclass(frozen=True)
class SetStyle:
    """Number of the colour in the style sheet, and what is drawn at a set's places."""

    index: int
    marker: str


_PRESENT_STYLE = SetStyle(PRESENT_INDEX, MARKERS[0])


def set_style(name: str, present: str, chosen: str | None = None) -> SetStyle:
    """What a set would like to look like, from its name alone, so that it does in every run, figure and flight.

    Where the other sets of the study are known `set_styles` gives each a look of its own.

    Parameters
    ----------
    present : name of the set that flies now
    chosen : name of the set that is decided for; None where none is known of
    """
    if name == present:
        return _PRESENT_STYLE
    colour, marker = _preferences(name)
    return SetStyle(CHOSEN_INDEX if name == chosen else _FREE_COLOURS[colour], _FREE_MARKERS[marker])


def set_styles(names: Iterable[str], present: str, chosen: str | None = None) -> dict[str, SetStyle]:
    """The look of each set of a study: as `set_style`, no colour twice before all are taken, no look twice before all
    are.

    Parameters
    ----------
    names : of all sets of the study, whatever of them is shown, so that a set looks alike wherever it is shown; their
        order does not matter: where two would look alike the later in the alphabet takes the next that is free
    present, chosen : as of `set_style`
    """
    styles: dict[str, SetStyle] = {}
    colours, markers, looks = Counter[int](), Counter[int](), Counter[tuple[int, int]]()
    for name in sorted(set(names)):
        if name == present:
            styles[name] = _PRESENT_STYLE
            continue
        first_colour, first_marker = _preferences(name)
        colour, marker = min(
            ((c, m) for c in range(len(_FREE_COLOURS)) for m in range(len(_FREE_MARKERS))),
            key=lambda look: (
                looks[look],
                colours[look[0]],
                markers[look[1]],
                (look[0] - first_colour) % len(_FREE_COLOURS),
                (look[1] - first_marker) % len(_FREE_MARKERS),
            ),
        )
        colours[colour] += 1
        markers[marker] += 1
        looks[colour, marker] += 1
        styles[name] = SetStyle(CHOSEN_INDEX if name == chosen else _FREE_COLOURS[colour], _FREE_MARKERS[marker])
    return styles


def _preferences(name: str) -> tuple[int, int]:
    """Places among the free colours and the free markers."""
    number = crc32(name.encode("utf-8", "surrogatepass"))
    return number % len(_FREE_COLOURS), number // len(_FREE_COLOURS) % len(_FREE_MARKERS)
