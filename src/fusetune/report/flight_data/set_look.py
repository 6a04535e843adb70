"""Colour and marker of a set, from its name alone."""

from __future__ import annotations

import zlib
from typing import NamedTuple

MARKERS = ("circle", "square", "diamond", "triangle", "cross", "plus", "star", "wedge")


class SetStyle(NamedTuple):
    """Index of the colour, 0 for the present set, and marker."""

    index: int
    marker: str


def set_style(name: str, present: str) -> SetStyle:
    """How a set looks in every figure."""
    if name == present:
        return SetStyle(0, MARKERS[0])
    number = zlib.crc32(name.encode())
    return SetStyle(1 + number % 7, MARKERS[1 + number // 7 % 7])
