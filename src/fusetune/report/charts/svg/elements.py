"""Shapes of SVG as text. Colours are those of the classes in `charts.css`; nothing here has a style of its own."""

from __future__ import annotations

import math
from collections.abc import Iterable
from html import escape
from zlib import crc32

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def px(value: float) -> str:
    """A length to a tenth of a pixel, which is all that can be seen."""
    text = f"{value:.1f}"
    return text[:-2] if text.endswith(".0") else text


def group(kind: str, *parts: str) -> str:
    """Parts that share a class, which gives them a colour."""
    return f'<g class="{escape(kind)}">{"".join(parts)}</g>'


def hinted(hint: str, *parts: str) -> str:
    """Parts that say something where the pointer rests on them."""
    return f"<g>{title(hint)}{''.join(parts)}</g>"


def title(hint: str) -> str:
    """First of the parts of a group: what it says where the pointer rests on it."""
    return f"<title>{escape(hint)}</title>"


def line(x1: float, y1: float, x2: float, y2: float, kind: str) -> str:
    """From one point to another."""
    return f'<line class="{kind}" x1="{px(x1)}" y1="{px(y1)}" x2="{px(x2)}" y2="{px(y2)}"/>'


def rectangle(x1: float, y1: float, x2: float, y2: float, kind: str, extra: str = "") -> str:
    """Between two opposite corners."""
    left, top = min(x1, x2), min(y1, y2)
    size = f'width="{px(abs(x2 - x1))}" height="{px(abs(y2 - y1))}"'
    return f'<rect class="{kind}" x="{px(left)}" y="{px(top)}" {size}{extra}/>'


def text(x: float, y: float, words: str, kind: str = "", anchor: str = "start", extra: str = "") -> str:
    """Words at the left ("start"), around ("middle") or to the left of ("end") a point."""
    named = f' class="{kind}"' if kind else ""
    placed = "" if anchor == "start" else f' text-anchor="{anchor}"'
    return f'<text{named} x="{px(x)}" y="{px(y)}"{placed}{extra}>{escape(words)}</text>'


def path(x: npt.ArrayLike, y: npt.ArrayLike, kind: str) -> str:
    """A line through points, with a gap where one of the coordinates is not known; empty where nothing is."""
    return f'<path class="{kind}" d="{steps}"/>' if (steps := path_steps(x, y)) else ""


def boxed(low: float, q1: float, median: float, q3: float, high: float, y: float, half: float = 5.0) -> str:
    """A lying box with whiskers and its median, as one path."""
    whiskers = f"M{px(low)} {px(y)}H{px(q1)}M{px(q3)} {px(y)}H{px(high)}"
    box = f"M{px(q1)} {px(y - half)}H{px(q3)}V{px(y + half)}H{px(q1)}Z"
    return f'<path class="box" d="{whiskers}{box}M{px(median)} {px(y - half)}v{px(2.0 * half)}"/>'


def dots(x: npt.ArrayLike, y: npt.ArrayLike, radius: float, kind: str) -> str:
    """Many circles as one path, those that would lie on each other once; empty where there are none."""
    arc = f"a{px(radius)} {px(radius)} 0 1 0"
    once = f"{arc} {px(2.0 * radius)} 0{arc} {px(-2.0 * radius)} 0"
    steps = "".join(f"M{px(across - radius)} {px(down)}{once}" for across, down in _places(x, y))
    return f'<path class="{kind}" d="{steps}"/>' if steps else ""


def crosses(x: npt.ArrayLike, y: npt.ArrayLike, radius: float, kind: str) -> str:
    """Many crosses as one path."""
    d = px(2.0 * radius)
    steps = "".join(
        f"M{px(across - radius)} {px(down - radius)}l{d} {d}m0-{d}l-{d} {d}" for across, down in _places(x, y)
    )
    return f'<path class="{kind}" d="{steps}"/>' if steps else ""


def _places(x: npt.ArrayLike, y: npt.ArrayLike) -> list[tuple[float, float]]:
    """Known places to a tenth of a pixel, each once."""
    pairs = np.round(np.column_stack(np.broadcast_arrays(np.ravel(x), np.ravel(y))).astype(np.float64), 1)
    return sorted({(a, b) for a, b in pairs.tolist() if math.isfinite(a + b)})


def area(x: npt.ArrayLike, low: npt.ArrayLike, high: npt.ArrayLike, kind: str) -> str:
    """What lies between two lines over the same places; empty where nothing is known."""
    across, below, above = (np.asarray(one, np.float64) for one in (x, low, high))
    known = np.isfinite(across) & np.isfinite(below) & np.isfinite(above)
    if np.count_nonzero(known) < 2:
        return ""
    across, below, above = across[known], below[known], above[known]
    steps = path_steps(np.concatenate([across, across[::-1]]), np.concatenate([below, above[::-1]]))
    return f'<path class="{kind}" d="{steps}Z"/>'


def path_steps(x: npt.ArrayLike, y: npt.ArrayLike) -> str:
    """What a path does, to a tenth of a pixel."""
    tenths = np.round(10.0 * np.column_stack([np.ravel(x), np.ravel(y)]).astype(np.float64))
    known = np.asarray(np.isfinite(tenths).all(axis=1))
    # points that fall onto the one before are not seen
    repeated = np.zeros(len(tenths), bool)
    repeated[1:] = known[1:] & known[:-1] & (tenths[1:] == tenths[:-1]).all(axis=1)
    shown = known & ~repeated
    begins = np.ones(len(tenths), bool)
    begins[1:] = ~known[:-1]
    letters = np.where(begins, "M", "L")[shown].tolist()
    return "".join(
        f"{letter}{across:g} {down:g}"
        for letter, (across, down) in zip(letters, (0.1 * tenths[shown]).round(1).tolist(), strict=True)
    )


def svg(name: str, heading: str, description: str, width: float, height: float, parts: Iterable[str], kind: str) -> str:
    """A chart that a page holds, as large as the page gives it room.

    Parameters
    ----------
    name : what the id begins with
    heading, description : what it shows, and what it says in words, for those who do not see it
    width, height : of the view box; it is readable at this width
    kind : class beside "chart"
    """
    inside = "".join(parts)
    told = title(heading), f"<desc>{escape(description)}</desc>"
    # alike charts alone have the same id
    key = f"{name}-{crc32((inside + told[0] + told[1]).encode('utf-8', 'surrogatepass')):08x}"
    head = told[0].replace("<title>", f'<title id="{key}-t">'), told[1].replace("<desc>", f'<desc id="{key}-d">')
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="{f"chart {kind}".rstrip()}" role="img" '
        f'viewBox="0 0 {px(width)} {px(height)}" aria-labelledby="{key}-t {key}-d">{"".join(head)}{inside}</svg>'
    )
