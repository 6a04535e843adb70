"""How wide words are, without a font: enough to make room for them."""

from __future__ import annotations

from functools import lru_cache

FONT_SIZE = 11.5
"""Of all words in a chart, in units of its view box, which are pixels at its natural width."""

BOLDER = 1.09
"""How many times as wide bold words are."""

_WIDTHS = (
    *(32, 40, 46, 84, 64, 95, 78, 27, 39, 39, 50, 84, 32, 36, 32, 34),
    *(64, 64, 64, 64, 64, 64, 64, 64, 64, 64, 34, 34, 84, 84, 84, 53),
    *(100, 68, 69, 70, 77, 63, 58, 77, 75, 29, 29, 66, 56, 86, 75, 79, 60, 79, 69, 63, 61, 73, 68, 99, 69, 61, 69),
    *(39, 34, 39, 84, 50, 50),
    *(61, 63, 55, 63, 62, 35, 63, 63, 28, 28, 58, 28, 97, 63, 61, 63, 63, 41, 52, 39, 63, 59, 82, 59, 59, 52),
    *(64, 34, 64, 84),
)
"""Hundredths of the size, from the space to the tilde, of DejaVu Sans, which is wider than most fonts."""
_BY_LETTER = {chr(32 + place): width for place, width in enumerate(_WIDTHS)}
_OTHERS = 70
_ELLIPSIS = "…"
_HEADS = (1 / 3, 1 / 2, 2 / 3, 5 / 6, 1 / 6, 1.0, 0.0)
"""Of what is kept of a name; of those that keep equally many names apart the first."""


def text_width(words: str, size: float = FONT_SIZE) -> float:
    """Width of words at a size."""
    return size * 0.01 * sum(_BY_LETTER.get(letter, _OTHERS) for letter in words)


def fitted(words: str, width: float, size: float = FONT_SIZE, head: float = 1 / 3) -> str:
    """Words that are no wider than a width: of longer ones the middle goes, and a share of what is kept is the head."""
    if text_width(words, size) <= width:
        return words
    for kept in range(len(words) - 1, 1, -1):
        first = round(kept * head)
        shorter = f"{words[:first]}{_ELLIPSIS}{words[len(words) - (kept - first) :]}"
        if text_width(shorter, size) <= width:
            return shorter
    return _ELLIPSIS


@lru_cache(maxsize=64)
def fitted_names(names: tuple[str, ...], width: float, size: float = FONT_SIZE) -> list[str]:
    """Names that are no wider than a width and, where any way of shortening does that, still differ.

    Flights often differ at the end of their names, sets at the beginning or in the middle.
    """
    if all(text_width(name, size) <= width for name in names):
        return list(names)
    tried = [[fitted(name, width, size, head) for name in names] for head in _HEADS]
    return max(tried, key=lambda shown: len(set(shown)))


def ends_fitted(words: str, width: float, size: float = FONT_SIZE) -> str:
    """Words that are no wider than a width: the end of longer ones goes, as titles say what matters first."""
    return fitted(words, width, size, 1.0)
