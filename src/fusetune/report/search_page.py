"""The page of a search by itself."""

from __future__ import annotations

from pathlib import Path

from fusetune.report.flight_names import short_names
from fusetune.report.markup import bullets, details
from fusetune.report.page_shell.shell import PageHead, Tab, write_page
from fusetune.report.search_results import read_search
from fusetune.report.sections.search_section import search_answer, search_evidence, search_found, search_next_steps
from fusetune.storage.files import AnyPath

SEARCH_PAGE = "search.html"


def build_search_page(folder: AnyPath) -> Path:
    """Write `search.html` into the folder of a search; returns that.

    Raises
    ------
    UserError
        A file of the search is missing or damaged.
    """
    target = Path(folder)
    results = read_search(target)
    decision = results.decision
    # the last one is the next steps, which have a section of their own, and cautions stand at the head
    told = [one for one in decision["paragraphs"][:-1] if one not in decision["cautions"]]
    sections = (
        search_answer(results),
        search_found(results),
        search_evidence(results),
        search_next_steps(results),
        details("The decision in words", bullets(told)),
    )
    output = target / SEARCH_PAGE
    write_page(
        output,
        PageHead("EKF2 parameters: the search", "Which EKF2 parameters to set", str(results.search["product"])),
        [Tab("search", "Search", "\n".join(filter(None, sections)))],
        names=short_names(results.search["flights"]),
    )
    return output
