"""The page of a folder of results, made anew."""

from __future__ import annotations

from tests.workflow.conftest import Workspace

from fusetune.apply.results_folder import ResultsFolder
from fusetune.report.results_page import PAGE, write_results_page


def test_the_page_made_anew_is_that_of_the_run(demonstration: Workspace) -> None:
    results = ResultsFolder(demonstration.folder / "results")
    anew = write_results_page(results, results.path / "anew.html")
    try:
        assert anew.read_bytes() == (results.path / PAGE).read_bytes()
    finally:
        anew.unlink()
