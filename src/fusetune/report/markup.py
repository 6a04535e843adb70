"""Small pieces of HTML: escaped text, tables, figures as data URIs."""

import base64
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from urllib.parse import quote

from fusetune.storage.files import AnyPath

_QUOTED = re.compile(r"`([^`]+)`")
_MEDIA_TYPES = {".svg": "image/svg+xml", ".png": "image/png"}


@dataclass(frozen=True)
class Cell:
    """A table cell; `kind` is a class of the style sheet ("good", "bad", "best", "quiet", "number"), `link` the page
    beside this one that it leads to, `hint` what is told where the pointer rests."""

    text: str
    kind: str = ""
    link: str = ""
    hint: str = ""


@dataclass(frozen=True)
class Html:
    """A table cell, or a part of one, that is HTML already: all text in it is escaped."""

    html: str
    kind: str = ""


CellLike = Cell | Html | str


def number(value: object, digits: int = 3, kind: str = "number") -> Cell:
    """A right-aligned figure with significant digits; "–" where there is none."""
    if not isinstance(value, int | float) or not math.isfinite(value):
        return Cell("–", f"{kind} quiet")
    text = f"{value:.{digits}g}"
    if "e" in text and 1e-4 <= abs(value) < 1e6:
        text = f"{value:.0f}" if abs(value) >= 1.0 else f"{value:.{digits + 3}f}".rstrip("0")
    return Cell(text.replace("-", "−"), kind)


def signed(value: object, digits: int = 1, kind: str = "number") -> Cell:
    """A right-aligned figure with its sign and a fixed number of decimals."""
    if not isinstance(value, int | float) or not math.isfinite(value):
        return Cell("–", f"{kind} quiet")
    return Cell(f"{value:+.{digits}f}".replace("-", "−"), kind)


def unit_cell(unit: str) -> Cell:
    """A unit beside a figure, powers of PX4's spelling raised."""
    return Cell(raised(unit), "quiet")


def raised(unit: str) -> str:
    """A unit whose powers are raised."""
    return unit.replace("^2", "²").replace("^3", "³")


def table(
    head: Sequence[str], rows: Sequence[Sequence[CellLike]], caption: str = "", kind: str = "", footer: str = ""
) -> str:
    """A table that scrolls sideways in its own box where it is too wide.

    Parameters
    ----------
    kind : class of the style sheet; of a table that is `cards` each row is a card on a phone
    footer : beneath, in a quiet voice
    """
    if not rows:
        return ""
    return grouped_table(head, {"": rows}, caption, kind, footer)


def grouped_table(
    head: Sequence[str],
    groups: Mapping[str, Sequence[Sequence[CellLike]]],
    caption: str = "",
    kind: str = "",
    footer: str = "",
) -> str:
    """A table whose rows stand in groups, each under its name."""
    rows = [row for group in groups.values() for row in group]
    numeric = [_is_number(column) for column in zip(*rows, strict=True)] if rows else [False] * len(head)
    titles = "".join(
        f'<th scope="col"{_class("number" if is_number else "")}>{escape(text)}</th>'
        for text, is_number in zip(head, numeric, strict=True)
    )
    told = f"<caption>{prose(caption)}</caption>" if caption else ""
    bodies = []
    for name, group in groups.items():
        title = f'<tr class="group"><th scope="rowgroup" colspan="{len(head)}">{prose(name)}</th></tr>' if name else ""
        bodies.append(f"<tbody>{title}{''.join(_row(row, head) for row in group)}</tbody>")
    below = f'<p class="note">{prose(footer)}</p>' if footer else ""
    inside = f"{told}<thead><tr>{titles}</tr></thead>{''.join(bodies)}"
    return f'<div class="scroll"><table{_class(kind)}>{inside}</table></div>{below}'


def _class(kind: str) -> str:
    return f' class="{escape(kind)}"' if kind else ""


def _row(row: Sequence[CellLike], head: Sequence[str]) -> str:
    return "<tr>" + "".join(_cell(cell, title) for cell, title in zip(row, head, strict=True)) + "</tr>"


def _is_number(column: Sequence[CellLike]) -> bool:
    return any(not isinstance(cell, str) and "number" in cell.kind for cell in column)


def _cell(cell: CellLike, title: str) -> str:
    label = f' data-label="{escape(title)}"' if title else ""
    if isinstance(cell, str):
        return f"<td{label}>{prose(cell)}</td>"
    if isinstance(cell, Html):
        return f"<td{_class(cell.kind)}{label}>{cell.html}</td>"
    hint = f' title="{escape(cell.hint)}"' if cell.hint else ""
    inside = link(cell.text, cell.link) if cell.link else prose(cell.text)
    return f"<td{_class(cell.kind)}{label}{hint}>{inside}</td>"


def link(text: str, page: AnyPath, place: str = "") -> str:
    """Leads to another page, named relative to this one, or to a place on it."""
    target = quote(Path(page).as_posix()) + (f"#at={quote(place)}" if place else "")
    return f'<a href="{target}">{escape(text)}</a>'


def anchor(text: str, id: str) -> str:
    """Leads to a place on this page, whichever tab it is in."""
    return f'<a href="#{escape(id)}">{escape(text)}</a>'


def figure(path: AnyPath, caption: str) -> str:
    """A picture inside the page."""
    path = Path(path)
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    source = f"data:{_MEDIA_TYPES[path.suffix]};base64,{data}"
    text = escape(caption)
    return (
        f'<figure><div class="scroll"><img alt="{text}" src="{source}"></div><figcaption>{text}</figcaption></figure>'
    )


def section(title: str, *parts: str, id: str = "") -> str:
    """A part of the page with its heading; empty where there is nothing in it."""
    if not any(parts):
        return ""
    name = f' id="{escape(id)}"' if id else ""
    return f"<section{name}><h2>{escape(title)}</h2>{''.join(parts)}</section>"


def drawn(picture: str, caption: str = "") -> str:
    """A picture that is HTML already (`fusetune.report.charts`), with words beneath; empty without a picture."""
    if not picture:
        return ""
    words = f"<figcaption>{prose(caption)}</figcaption>" if caption else ""
    return f'<figure class="drawn">{picture}{words}</figure>'


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph of plain text."""
    attribute = f' class="{escape(kind)}"' if kind else ""
    return f"<p{attribute}>{prose(text)}</p>"


def prose(text: str) -> str:
    """Escaped, names in back quotes as code, no line break between a figure and its percent sign."""
    return _QUOTED.sub(r"<code>\1</code>", escape(text).replace(" %", "&nbsp;%"))


def bullets(sentences: Sequence[str], kind: str = "") -> str:
    """A list of plain sentences."""
    return f"<ul{_class(kind)}>" + "".join(f"<li>{prose(one)}</li>" for one in sentences) + "</ul>" if sentences else ""


def details(summary: str, *parts: str, kind: str = "", id: str = "") -> str:
    """A part that opens on a click, and on paper; empty where there is nothing in it."""
    if not any(parts):
        return ""
    mark = f' <span class="dot {escape(kind)}" aria-hidden="true"></span>' if kind else ""
    name = f' id="{escape(id)}"' if id else ""
    return f"<details{name}><summary>{escape(summary)}{mark}</summary>{''.join(parts)}</details>"


def severity_mark(severity: str, words: str) -> str:
    """Words on the colour of a severity."""
    return f'<span class="tag is-{escape(severity)}">{escape(words)}</span>'
