"""The page of a search by itself."""

from __future__ import annotations

from pathlib import Path

from fusetune.report.figures.search_figures import plot_search
from fusetune.report.html_page import PageHead, write_page
from fusetune.report.markup import bullets, section
from fusetune.report.search_results import read_search
from fusetune.report.sections.search_section import search_next_steps, search_section
from fusetune.storage.files import AnyPath

SEARCH_PAGE = "search.html"


def build_search_page(folder: AnyPath) -> Path:
    """Draw the figures of a search into `figures` of its folder, and write `search.html` beside; returns that.

    Raises
    ------
    UserError
        A file of the search is missing or damaged.
    """
    target = Path(folder)
    results = read_search(target)
    figures = target / "figures"
    plot_search(results, figures)
    decision = results.decision
    count = len(results.search["flights"])
    vehicle = decision["vehicle"]["in_words"] if decision["vehicle"] else "unknown vehicle"
    origin = f"{results.search['product']}, {vehicle}, from {count} flight{'s' if count != 1 else ''}"
    # the last one is the next steps, which have a section of their own, and cautions stand at the head
    told = [one for one in decision["paragraphs"][:-1] if one not in decision["cautions"]]
    words = section("The decision in words", bullets(told))
    output = target / SEARCH_PAGE
    write_page(
        output,
        PageHead("EKF2 parameters: the search", "Which EKF2 parameters to set", origin),
        (search_section(results, figures), search_next_steps(results), words),
    )
    return output
