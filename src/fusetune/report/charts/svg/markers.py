"""What is drawn at a set's places."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fusetune.report.charts.svg.elements import px

_Points = Sequence[tuple[float, float]]

_CLOSED: Mapping[str, _Points] = {
    "square": ((-0.86, -0.86), (0.86, -0.86), (0.86, 0.86), (-0.86, 0.86)),
    "diamond": ((0.0, -1.2), (1.2, 0.0), (0.0, 1.2), (-1.2, 0.0)),
    "triangle": ((0.0, -1.15), (1.1, 0.85), (-1.1, 0.85)),
    "down": ((0.0, 1.15), (1.1, -0.85), (-1.1, -0.85)),
    "plus": (
        *((-0.4, -1.1), (0.4, -1.1), (0.4, -0.4), (1.1, -0.4), (1.1, 0.4), (0.4, 0.4)),
        *((0.4, 1.1), (-0.4, 1.1), (-0.4, 0.4), (-1.1, 0.4), (-1.1, -0.4), (-0.4, -0.4)),
    ),
    "cross": (
        *((0.0, -0.55), (0.55, -1.1), (1.1, -0.55), (0.55, 0.0), (1.1, 0.55), (0.55, 1.1)),
        *((0.0, 0.55), (-0.55, 1.1), (-1.1, 0.55), (-0.55, 0.0), (-1.1, -0.55), (-0.55, -1.1)),
    ),
    "star": (
        *((0.0, -1.3), (0.32, -0.44), (1.24, -0.4), (0.51, 0.17), (0.76, 1.05)),
        *((0.0, 0.54), (-0.76, 1.05), (-0.51, 0.17), (-1.24, -0.4), (-0.32, -0.44)),
    ),
}
"""Corners of each around the middle, in radii of the circle that looks as large."""


def marker(shape: str, x: float, y: float, radius: float = 4.0, *, hollow: bool = False) -> str:
    """A shape at a point, in the colour of the group that it is in.

    Parameters
    ----------
    shape : of `fusetune.report.set_styles.MARKERS`
    hollow : only its outline
    """
    kind = "hollow" if hollow else "mark"
    if shape == "circle":
        return f'<circle class="{kind}" cx="{px(x)}" cy="{px(y)}" r="{px(radius)}"/>'
    corners = "L".join(f"{px(x + radius * a)} {px(y + radius * b)}" for a, b in _CLOSED[shape])
    return f'<path class="{kind}" d="M{corners}Z"/>'
