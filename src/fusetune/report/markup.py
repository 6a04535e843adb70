"""Small pieces of HTML: escaped text, tables, figures as data URIs."""

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from urllib.parse import quote

from fusetune.storage.files import AnyPath

_MEDIA_TYPES = {".svg": "image/svg+xml", ".png": "image/png"}


@dataclass(frozen=True)
class Cell:
    """A table cell; `kind` is a class of the style sheet ("good", "bad", "best", "quiet", "number"), `link` the page
    beside this one that it leads to, `hint` what is told where the pointer rests."""

    text: str
    kind: str = ""
    link: str = ""
    hint: str = ""


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
    return Cell(unit.replace("^2", "²"), "quiet")


def table(head: Sequence[str], rows: Sequence[Sequence[Cell | str]], caption: str = "") -> str:
    """A table that scrolls sideways on a small screen."""
    parts = ['<div class="scroll"><table>']
    if caption:
        parts.append(f"<caption>{escape(caption)}</caption>")
    kinds = [' class="number"' if _is_number(column) else "" for column in zip(*rows, strict=True)] or [""] * len(head)
    titles = "".join(f"<th{kind}>{escape(text)}</th>" for text, kind in zip(head, kinds, strict=True))
    parts.append(f"<thead><tr>{titles}</tr></thead><tbody>")
    for row in rows:
        parts.append("<tr>" + "".join(_cell(cell) for cell in row) + "</tr>")
    parts.append("</tbody></table></div>")
    return "".join(parts)


def _is_number(column: Sequence[Cell | str]) -> bool:
    return any(isinstance(cell, Cell) and "number" in cell.kind for cell in column)


def _cell(cell: Cell | str) -> str:
    if isinstance(cell, str):
        return f"<td>{_prose(cell)}</td>"
    kind = f' class="{escape(cell.kind)}"' if cell.kind else ""
    hint = f' title="{escape(cell.hint)}"' if cell.hint else ""
    return f"<td{kind}{hint}>{link(cell.text, cell.link) if cell.link else escape(cell.text)}</td>"


def link(text: str, page: AnyPath) -> str:
    """Leads to another page, named relative to this one."""
    return f'<a href="{quote(Path(page).as_posix())}">{escape(text)}</a>'


def figure(path: AnyPath, caption: str) -> str:
    """A picture inside the page."""
    path = Path(path)
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    source = f"data:{_MEDIA_TYPES[path.suffix]};base64,{data}"
    text = escape(caption)
    return (
        f'<figure><div class="scroll"><img alt="{text}" src="{source}"></div><figcaption>{text}</figcaption></figure>'
    )


def section(title: str, *parts: str) -> str:
    """A part of the page with its heading."""
    return f"<section><h2>{escape(title)}</h2>{''.join(parts)}</section>"


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph of plain text."""
    attribute = f' class="{escape(kind)}"' if kind else ""
    return f"<p{attribute}>{_prose(text)}</p>"


def _prose(text: str) -> str:
    """Escaped, no line break between a figure and its percent sign."""
    return escape(text).replace(" %", "&nbsp;%")


def bullets(sentences: Sequence[str]) -> str:
    """A list of plain sentences."""
    return "<ul>" + "".join(f"<li>{_prose(one)}</li>" for one in sentences) + "</ul>" if sentences else ""


def details(summary: str, *parts: str, kind: str = "") -> str:
    """A part that opens on a click; printing opens all."""
    mark = f' <span class="{escape(kind)}">●</span>' if kind else ""
    return f"<details><summary>{escape(summary)}{mark}</summary>{''.join(parts)}</details>"


def severity_mark(severity: str, words: str) -> str:
    """Words on the colour of a severity."""
    return f'<span class="tag is-{escape(severity)}">{escape(words)}</span>'
