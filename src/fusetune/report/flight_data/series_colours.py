"""Colours of the curves of a panel: those of the sets; what is of no set has one that the sets beside it leave."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import cycle
from typing import Any

from fusetune.report.set_styles import COLOURS, PRESENT_INDEX

_COLOURS = (*range(1, COLOURS), PRESENT_INDEX)
"""Of what is of no set, in this order."""


def coloured(panels: Iterable[Mapping[str, Any]], sets: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Panels of a header, each series with its `style`.

    Parameters
    ----------
    sets : of the header
    """
    styles = {one["name"]: one["style"] for one in sets}
    return [{**panel, "series": _of_panel(panel["series"], styles)} for panel in panels]


def _of_panel(series: Iterable[Mapping[str, Any]], styles: Mapping[str, int]) -> list[dict[str, Any]]:
    taken = {styles[one["set"]] for one in series if one["set"] is not None}
    others = cycle([number for number in _COLOURS if number not in taken] or _COLOURS)
    return [{**one, "style": next(others) if one["set"] is None else styles[one["set"]]} for one in series]
