"""What surrounds charts on a page: their title, others beside them, and the same figures as a table."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from fusetune.report.markup import Cell, details, table

AS_TABLE = "The figures as a table"


def chart_block(title: str, charts: Sequence[str], below: str = "") -> str:
    """Charts beside one another, as many as there is room for, under a title that says what they show.

    Parameters
    ----------
    title : plain text; none where it is empty
    charts : SVG
    below : HTML, such as a table
    """
    if not charts:
        return ""
    words = f'<p class="chart-title">{escape(title).replace(" %", "&nbsp;%")}</p>' if title else ""
    return f'<div class="chart-block">{words}<div class="charts">{"".join(charts)}</div>{below}</div>'


def figures_table(head: Sequence[str], rows: Sequence[Sequence[Cell | str]]) -> str:
    """The figures of a chart behind a click, for those who do not see it or want to copy them."""
    return details(AS_TABLE, table(head, rows)) if rows else ""


def in_a_box(chart: str, hint: str) -> str:
    """A chart that may be wider than a phone: it moves sideways in a box of its own, which the keyboard reaches."""
    return (
        f'<div class="chart-scroll" tabindex="0" role="group" aria-label="{escape(hint)}">{chart}</div>'
        f'<p class="chart-hint">{escape(hint)}</p>'
    )


def two_forms(narrow: str, wide: str) -> str:
    """A chart in the form for which the page has room."""
    return f'<div class="chart-forms"><div class="is-narrow">{narrow}</div><div class="is-wide">{wide}</div></div>'
