"""Where the viewer of single flights stands in the report."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from fusetune.report.markup import paragraph, section
from fusetune.report.page_shell.shell import VIEWER_CLASS, FlightBlob
from fusetune.report.sections.flights_section import Logs


def viewer_section(blobs: Sequence[FlightBlob], logs: Logs, first: Sequence[str] = ()) -> str:
    """The viewer, with flights to choose from; where the page holds none, where to see them; empty without flights.

    Parameters
    ----------
    first : flights of which it shows the newest first
    """
    if blobs:
        shown = {blob.flight for blob in blobs}
        newest = next((f' data-first="{escape(name)}"' for name in reversed(first) if name in shown), "")
        mount = f'<div class="{VIEWER_CLASS}" data-choose{newest}></div>'
        return section("Look into a flight", mount, id="viewer")
    if not logs.pages:
        return ""
    text = "So many flights do not fit into one page: the page of each shows it over time. Its name above leads there."
    return section("Look into a flight", paragraph(text), id="viewer")
