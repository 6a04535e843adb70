"""A page that needs no network: its style and pictures are inside."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from fusetune.report.markup import link
from fusetune.storage.files import AnyPath, atomic_path

STYLE_SHEET = Path(__file__).with_name("page.css")

_PRINT = "addEventListener('beforeprint',()=>document.querySelectorAll('details').forEach(d=>d.open=true))"


@dataclass(frozen=True)
class PageHead:
    """What a page is called in the browser, its first line, and what it was made from."""

    title: str
    heading: str
    origin: str


def write_page(output: AnyPath, head: PageHead, sections: Sequence[str]) -> None:
    """Write sections, which are HTML, as a page."""
    page = (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(head.title)}</title><style>{STYLE_SHEET.read_text(encoding='utf-8')}</style>"
        "</head><body>"
        f"<header><h1>{escape(head.heading)}</h1><p>{escape(head.origin)}</p></header>"
        + "\n".join(sections)
        + f"<script>{_PRINT}</script></body></html>\n"
    )
    with atomic_path(output) as temporary:
        temporary.write_text(page, encoding="utf-8")


def page_links(pages: Mapping[str, AnyPath], page: AnyPath) -> str:
    """A line of links from one page to others, each relative to where that page lies."""
    folder = Path(page).parent
    links = "".join(link(words, os.path.relpath(target, folder)) for words, target in pages.items())
    return f'<nav aria-label="other pages">{links}</nav>' if links else ""
