"""The looks of the sets in charts, and what their names are followed by."""

from __future__ import annotations

from collections.abc import Sequence

from fusetune.report.charts.svg.elements import group, title
from fusetune.report.charts.svg.legend import Entry, marker_symbol
from fusetune.report.charts.svg.markers import marker
from fusetune.report.results import Results


def set_class(results: Results, name: str) -> str:
    """Class that gives what is drawn of a set its colour; paler where it cannot be chosen."""
    return f"set-{results.styles[name].index}" + (" out" if results.is_ruled_out(name) else "")


def set_marker(results: Results, name: str, x: float, y: float, radius: float = 4.0) -> str:
    """The marker of a set, hollow where it cannot be chosen."""
    return marker(results.styles[name].marker, x, y, radius, hollow=results.is_ruled_out(name))


def set_group(results: Results, name: str, hint: str, *parts: str) -> str:
    """Parts in the colour of a set that say something where the pointer rests."""
    return group(set_class(results, name), title(hint), *parts)


def name_class(results: Results, name: str) -> str:
    """Class of a set's name at a row."""
    if name == results.present:
        return "is-now"
    if name == results.decision["chosen"]:
        return "is-chosen"
    return "is-out" if results.is_ruled_out(name) else ""


def name_classes(results: Results, names: Sequence[str]) -> list[str]:
    """Of the names of rows."""
    return [name_class(results, name) for name in names]


def set_words(results: Results, name: str) -> str:
    """Name of a set and what it is beside others."""
    if name == results.present:
        return f"{name} (flies now)"
    if name == results.decision["chosen"]:
        return f"{name} (chosen)"
    return f"{name} (not eligible)" if results.is_ruled_out(name) else name


def set_entries(results: Results, names: Sequence[str], through: str = "") -> list[Entry]:
    """Entries of a legend."""
    return [
        Entry(
            marker_symbol(
                set_class(results, name),
                results.styles[name].marker,
                hollow=results.is_ruled_out(name),
                through=through,
            ),
            set_words(results, name),
        )
        for name in names
    ]
