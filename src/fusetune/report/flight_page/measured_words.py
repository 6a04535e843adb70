"""Measured figures whose names end in their unit, in words."""

from __future__ import annotations

from collections.abc import Mapping

from fusetune.report.markup import number
from fusetune.report.severity_words import cause_words

_UNITS: Mapping[str, str] = {
    "m_s2": "m/s²",
    "rad_s": "rad/s",
    "deg_s": "°/s",
    "m_s": "m/s",
    "per_ms": "per ms",
    "gauss": "gauss",
    "rad": "rad",
    "deg": "°",
    "ms": "ms",
    "m": "m",
    "s": "s",
}
"""Endings of names, the longer of two that fit first."""


def figure_in_words(name: str, value: float) -> str:
    """As `largest jump: 3.2 m` of `largest_jump_m`; a share in percent."""
    if name.endswith("_share"):
        return f"{cause_words(name)}: {number(100.0 * value).text} %"
    for ending, unit in _UNITS.items():
        if name.endswith(f"_{ending}"):
            gap = "" if unit.startswith("°") else " "
            return f"{cause_words(name.removesuffix(f'_{ending}'))}: {number(value, 4).text}{gap}{unit}"
    return f"{cause_words(name)}: {number(value, 4).text}"
