"""The page of a folder of results, made anew from what lies there."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fusetune.apply.results_folder import ResultsFolder
from fusetune.report.page import ReportInput, build_report
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
    health = results.optional("analyze", "health.parquet")
    given = ReportInput(
        flights_table=results.flights_table,
        analyze_folders=results.analyzed,
        apply_folder=results.path / "apply",
        diagnoses=results.diagnoses(flights),
        flight_pages=_of_flights(results, flights, "html"),
        blobs=_of_flights(results, flights, "blob"),
        health_table=health if results.optional("apply", "fleet.json") else None,
        mission=_mission(results),
        missions=results.optional("analyze", "missions.json"),
    )
    build_report(given, page)
    return page


def _of_flights(results: ResultsFolder, flights: Sequence[str], suffix: str) -> list[Path]:
    """What was made of each flight for the page, where it was."""
    return [one for flight in flights if (one := results.optional("report", "flights", f"{flight}.{suffix}"))]


def _mission(results: ResultsFolder) -> Path | None:
    """The outlook of the mission that was planned: of the files in `design`, the one beside a plan of its name."""
    design = results.path / "design"
    plans = sorted(design.glob("*.plan")) if design.is_dir() else []
    return next((file for plan in plans if (file := plan.with_suffix(".json")).is_file() and read_document(file)), None)
