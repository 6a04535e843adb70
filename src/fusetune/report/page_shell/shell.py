"""A page that needs no network: head, tabs, and at its end the data of flights."""

from __future__ import annotations

import base64
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path

from fusetune.report.markup import link
from fusetune.report.page_shell.assets import joined_assets
from fusetune.report.page_shell.glossary import glossary_list, with_terms_marked
from fusetune.report.page_shell.text_pass import with_own_ids, with_short_names
from fusetune.storage.files import AnyPath, atomic_path

VIEWER_CLASS = "flight-viewer"
"""Where this stands on a page, the viewer mounts."""


@dataclass(frozen=True)
class PageHead:
    """What a page is called in the browser, its first line, what it was made from, and links to others.

    Attributes
    ----------
    links : HTML of links, each beside the other
    """

    title: str
    heading: str
    origin: str
    links: str = ""


@dataclass(frozen=True)
class Tab:
    """A part of a page: its name in the address, its title, and its HTML."""

    id: str
    title: str
    html: str


@dataclass(frozen=True)
class FlightBlob:
    """What the viewer shows of a flight, packed."""

    flight: str
    data: bytes


def page_links(pages: Mapping[str, AnyPath], page: AnyPath) -> str:
    """Links from one page to others, each relative to where that page lies, for `PageHead.links`."""
    folder = Path(page).parent
    return "".join(link(words, os.path.relpath(target, folder)) for words, target in pages.items())


def write_page(
    output: AnyPath,
    head: PageHead,
    tabs: Sequence[Tab],
    blobs: Sequence[FlightBlob] = (),
    names: Mapping[str, str] | None = None,
) -> None:
    """Write a page of one or several tabs; of a single one there is no tab bar.

    The words of the field are marked where they first stand in a tab, and listed at the end of the last.

    Parameters
    ----------
    names : flights whose names are shortened in the text: whole → short
    """
    tabs = _with_words(tabs, names or {})
    body = _tab_bar(tabs) + with_own_ids(_main(tabs))
    assets = joined_assets(viewer=VIEWER_CLASS in body)
    page = (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{escape(assets.policy)}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(head.title)}</title><style>{assets.style}</style><script>{assets.script}</script></head>"
        f"<body>{_header(head)}{body}{_blobs(blobs)}</body></html>\n"
    )
    with atomic_path(output) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _with_words(tabs: Sequence[Tab], names: Mapping[str, str]) -> list[Tab]:
    used: set[str] = set()
    told = [replace(tab, html=with_terms_marked(with_short_names(tab.html, names), used)) for tab in tabs]
    words = glossary_list(used)
    if words:
        listed = f'<details class="words"><summary>Words of the field</summary>{words}</details>'
        told[-1] = replace(told[-1], html=told[-1].html + listed)
    return told


def _header(head: PageHead) -> str:
    links = f'<nav aria-label="other pages">{head.links}</nav>' if head.links else ""
    switch = '<button type="button" class="theme-switch" aria-pressed="false" hidden>Dark</button>'
    return (
        f'<header class="page-head"><div class="page-name"><h1>{escape(head.heading)}</h1>'
        f"<p>{escape(head.origin)}</p></div>{links}{switch}</header>"
    )


def _tab_bar(tabs: Sequence[Tab]) -> str:
    if len(tabs) == 1:
        return ""
    marks = "".join(
        f'<a role="tab" id="tab-{tab.id}" data-tab="{tab.id}" href="#panel-{tab.id}" aria-controls="panel-{tab.id}" '
        f'aria-selected="{"false" if index else "true"}">{escape(tab.title)}</a>'
        for index, tab in enumerate(tabs)
    )
    return f'<div class="tab-bar" role="tablist" aria-label="parts of the report">{marks}</div>'


def _main(tabs: Sequence[Tab]) -> str:
    if len(tabs) == 1:
        return f"<main>{tabs[0].html}</main>"
    panels = "".join(
        f'<section role="tabpanel" class="tab-panel{"" if index else " is-open"}" id="panel-{tab.id}" '
        f'aria-labelledby="tab-{tab.id}" data-title="{escape(tab.title)}" tabindex="-1">{tab.html}</section>'
        for index, tab in enumerate(tabs)
    )
    return f"<main>{panels}</main>"


def _blobs(blobs: Sequence[FlightBlob]) -> str:
    return "".join(
        f'<script type="application/octet-stream" class="flight-data" data-flight="{escape(blob.flight)}">'
        f"{base64.b64encode(blob.data).decode('ascii')}</script>"
        for blob in blobs
    )
