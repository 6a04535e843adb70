"""The page of a folder of results, made anew from what lies there."""

from __future__ import annotations

from pathlib import Path

from fusetune.apply.results_folder import ResultsFolder
from fusetune.report.page import build_report
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath

PAGE = "report.html"


def write_results_page(results: ResultsFolder, output: AnyPath | None = None) -> Path:
    """Write the page of what a run found.

    Parameters
    ----------
    output : the file; by default `report.html` in the folder

    Returns
    -------
    The page

    Raises
    ------
    UserError
        A file of the results is missing or damaged.
    """
    page = Path(output) if output is not None else results.path / PAGE
    flights = [row["flight"] for row in results.flights]
    report = results.path / "report"
    pages = [one for flight in flights if (one := report / "flights" / f"{flight}.html").is_file()]
    build_report(
        results.flights_table,
        results.analyzed,
        [report / "flights" / f"{flight}.png" for flight in results.replayable],
        results.path / "apply",
        report,
        page,
        results.diagnoses(flights),
        pages,
        results.optional("fleet.html"),
        _mission(results),
        results.optional("analyze", "missions.json"),
    )
    return page


def _mission(results: ResultsFolder) -> Path | None:
    """The outlook of the mission that was planned: of the files in `design`, the one beside a plan of its name."""
    design = results.path / "design"
    plans = sorted(design.glob("*.plan")) if design.is_dir() else []
    return next((file for plan in plans if (file := plan.with_suffix(".json")).is_file() and read_document(file)), None)
