"""Puts the report together: one page that needs no network."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fusetune.apply.flight_problems import OF_ALL_FLIGHTS
from fusetune.report.html_page import PageHead, page_links, write_page
from fusetune.report.results import read_results
from fusetune.report.sections.conformance_section import conformance_section
from fusetune.report.sections.decision_sections import decision_section, sets_section
from fusetune.report.sections.evidence_sections import (
    evidence_section,
    holds_section,
    paper_section,
    weights_section,
    withheld_section,
)
from fusetune.report.sections.findings_section import findings_section
from fusetune.report.sections.flight_sections import (
    as_flown_section,
    flight_figure_paths,
    flights_section,
    innovations_section,
    provenance_section,
    single_flights_section,
)
from fusetune.report.sections.health_section import health_section
from fusetune.report.sections.history_section import history_section
from fusetune.report.sections.mission_section import mission_section
from fusetune.report.sections.next_steps_section import next_steps_section
from fusetune.report.sections.sensitivity_section import sensitivity_section
from fusetune.report.sections.trust_section import trust_section
from fusetune.report.sections.truth_section import truth_section
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath


def build_report(
    flights_table: AnyPath,
    analyze_folders: Sequence[AnyPath],
    flight_figures: Sequence[AnyPath],
    apply_folder: AnyPath,
    figure_folder: AnyPath,
    output: AnyPath,
    diagnoses: Sequence[AnyPath] = (),
    flight_pages: Sequence[AnyPath] = (),
    fleet_page: AnyPath | None = None,
    mission: AnyPath | None = None,
    missions: AnyPath | None = None,
) -> None:
    """Write the report as one HTML file with its figures inside.

    Parameters
    ----------
    flights_table : `results/save/flights.parquet`, all logs with their verdicts
    analyze_folders : `results/analyze/<flight>` of the replayed flights
    flight_figures : a picture per flight (`plot_flight`), in the order of `analyze_folders`
    apply_folder : `results/apply`
    figure_folder : holds `SUMMARY_FIGURES` (`plot_summary`)
    output : `results/report.html`
    diagnoses : `results/analyze/<flight>/diagnosis.json` of all flights
    flight_pages : `results/report/flights/<flight>.html`
    fleet_page : `results/fleet.html`
    mission : `results/design/<mission>.json`
    missions : `results/analyze/missions.json`; None where flights were compared with none
    """
    results = read_results(analyze_folders, apply_folder)
    figures = Path(figure_folder)
    pictures = flight_figure_paths([Path(folder).name for folder in analyze_folders], flight_figures)
    sections = (
        page_links({"All flights": fleet_page} if fleet_page is not None else {}, output),
        decision_section(results),
        health_section(_of_single_flights(diagnoses), {Path(one).stem: one for one in flight_pages}, output),
        next_steps_section(results, figures),
        history_section(results.history),
        findings_section(results),
        evidence_section(results, figures),
        withheld_section(results, figures),
        conformance_section(results, [] if missions is None else read_document(missions)["missions"]),
        holds_section(results),
        sensitivity_section(results, figures),
        weights_section(results),
        paper_section(results),
        sets_section(results),
        flights_section(results, Path(flights_table)),
        trust_section(analyze_folders),
        innovations_section(results, figures),
        truth_section(results),
        as_flown_section(results),
        single_flights_section(results, pictures),
        mission_section(mission),
        provenance_section(results),
    )
    product = results.decision["provenance"]["product"]
    count = results.decision["flights_scored"]
    flights = "no flight" if not count else f"{count} flight{'s' if count > 1 else ''}"
    head = PageHead("EKF2 parameters: the decision", "Which EKF2 parameters to fly", f"{product}, from {flights}")
    write_page(output, head, sections)


def _of_single_flights(diagnoses: Sequence[AnyPath]) -> list[dict[str, Any]]:
    """What is wrong on each flight, without what the decision tells of all of them together."""
    found = [read_document(file) for file in diagnoses]
    return [
        one | {"diagnoses": [cause for cause in one["diagnoses"] if cause["id"] not in OF_ALL_FLIGHTS]} for one in found
    ]
