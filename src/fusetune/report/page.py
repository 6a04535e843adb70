"""Puts the report together: one page that needs no network."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fusetune.apply.flight_problems import OF_ALL_FLIGHTS
from fusetune.report.charts.differences import answer_chart
from fusetune.report.counted import count_words
from fusetune.report.fleet.fleet_results import FleetResults, read_fleet_results
from fusetune.report.fleet.matrix import matrix_section
from fusetune.report.fleet.statistics_sections import (
    changes_section,
    figures_section,
    outliers_section,
    untold,
    verdicts_section,
)
from fusetune.report.flight_data.write_blob import with_choice
from fusetune.report.flight_names import short_names
from fusetune.report.flight_page.sensors_section import HOW_TO_DRAW
from fusetune.report.markup import bullets, details
from fusetune.report.page_shell.shell import FlightBlob, PageHead, Tab, write_page
from fusetune.report.results import Results, read_results
from fusetune.report.sections.advice import advice_section
from fusetune.report.sections.conformance_section import conformance_section, not_flown
from fusetune.report.sections.evidence_sections import (
    evidence_section,
    flight_by_flight_section,
    holds_section,
    paper_section,
    weights_section,
    withheld_section,
)
from fusetune.report.sections.findings_section import findings_section
from fusetune.report.sections.first_screen import first_screen, heading
from fusetune.report.sections.flights_section import Logs, flights_section, single_flights_section
from fusetune.report.sections.health_section import health_answer, health_section
from fusetune.report.sections.history_section import history_section
from fusetune.report.sections.innovations_section import innovations_section
from fusetune.report.sections.mission_section import mission_section
from fusetune.report.sections.next_steps_section import next_steps_section
from fusetune.report.sections.provenance_section import provenance_section
from fusetune.report.sections.sensitivity_section import sensitivity_section
from fusetune.report.sections.sets_section import sets_section
from fusetune.report.sections.trust_section import read_trust, trust_section
from fusetune.report.sections.truth_section import truth_section
from fusetune.report.sections.viewer_section import viewer_section
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_table

MOST_BLOBS = 10_000_000
"""Bytes of packed flights that the page takes, 13 MB as text: beyond, the flights' own pages show them."""


@dataclass(frozen=True)
class ReportInput:
    """Files that the report is made of.

    Attributes
    ----------
    flights_table : `results/save/flights.parquet`, all logs with their verdicts
    analyze_folders : `results/analyze/<flight>` of the replayed flights
    apply_folder : `results/apply`
    diagnoses : `results/analyze/<flight>/diagnosis.json` of all flights
    flight_pages : `results/report/flights/<flight>.html`
    blobs : `results/report/flights/<flight>.blob`
    health_table : `results/analyze/health.parquet`, which `apply_folder/fleet.json` was made from; None leaves out what
        all flights show together
    mission : `results/design/<mission>.json`
    missions : `results/analyze/missions.json`; None where flights were compared with none
    """

    flights_table: AnyPath
    analyze_folders: Sequence[AnyPath]
    apply_folder: AnyPath
    diagnoses: Sequence[AnyPath] = ()
    flight_pages: Sequence[AnyPath] = ()
    blobs: Sequence[AnyPath] = ()
    health_table: AnyPath | None = None
    mission: AnyPath | None = None
    missions: AnyPath | None = None


@dataclass(frozen=True)
class _Read:
    """What was read of them."""

    results: Results
    logs: Logs
    trust: Sequence[dict[str, Any]]
    fleet: FleetResults | None
    missions: Sequence[Mapping[str, Any]]
    mission: AnyPath | None
    blobs: Sequence[FlightBlob] = field(default_factory=tuple)


def build_report(given: ReportInput, output: AnyPath) -> None:
    """Write the report as one HTML file with its figures and flights inside.

    Parameters
    ----------
    output : `results/report.html`

    Raises
    ------
    UserError
        A file is missing or damaged.
    """
    read = _read(given, output)
    decision, logs = read.results.decision, read.logs
    tabs = [
        Tab("decision", "Decision", _decision_tab(read)),
        Tab("flights", "Flights", _flights_tab(read)),
        Tab("parameters", "Parameters", _parameters_tab(read)),
        Tab("health", "Health", _health_tab(read)),
        Tab("sensors", "Sensors", _sensors_tab(read)),
        Tab("method", "Method", _method_tab(read)),
    ]
    origin = f"{decision['provenance']['product']} · {count_words(len(logs.verdicts), 'log')}"
    head = PageHead(f"{heading(read.results)} – EKF2 parameters", "Which EKF2 parameters to fly", origin)
    write_page(output, head, tabs, read.blobs, short_names(logs.verdicts))


def _read(given: ReportInput, output: AnyPath) -> _Read:
    verdicts = read_table(given.flights_table).to_pylist()
    trust = read_trust(given.analyze_folders)
    diagnoses = [_of_single_flight(read_document(file)) for file in given.diagnoses]
    logs = Logs.of(verdicts, diagnoses, trust, given.flight_pages, output)
    order = {name: place for place, name in enumerate(logs.verdicts)}
    folders = sorted(map(Path, given.analyze_folders), key=lambda folder: order.get(folder.name, len(order)))
    fleet_file = Path(given.apply_folder) / "fleet.json"
    results = read_results(folders, given.apply_folder)
    return _Read(
        results=results,
        logs=logs,
        trust=sorted(trust, key=lambda one: order.get(one["flight"], len(order))),
        fleet=None if given.health_table is None else _fleet(fleet_file, given.health_table, logs),
        missions=[] if given.missions is None else read_document(given.missions)["missions"],
        mission=given.mission,
        blobs=_blobs(given.blobs, order, results),
    )


def _fleet(fleet_file: Path, health_table: AnyPath, logs: Logs) -> FleetResults | None:
    """What all flights have in common; None where it was made of others than those that are listed.

    So it is where results were copied without the memory of how they were made, and all their logs are gone.
    """
    found = read_fleet_results(fleet_file, health_table, logs.pages)
    return found if {one["name"] for one in found.flights} <= {*logs.verdicts} else None


def _of_single_flight(diagnosis: dict[str, Any]) -> dict[str, Any]:
    """What is wrong on a flight, without what the decision tells of all of them together."""
    return diagnosis | {"diagnoses": [one for one in diagnosis["diagnoses"] if one["id"] not in OF_ALL_FLIGHTS]}


def _blobs(files: Sequence[AnyPath], order: Mapping[str, int], results: Results) -> tuple[FlightBlob, ...]:
    """Packed flights, the oldest first, their sets as the decision has them; none where they are too large together."""
    paths = sorted(map(Path, files), key=lambda file: order.get(file.stem, len(order)))
    if sum(file.stat().st_size for file in paths) > MOST_BLOBS:
        return ()
    # an empty one is of a log that nothing could be read of
    told = {file.stem: file.read_bytes() for file in paths if file.stat().st_size}
    out = {str(name) for name in results.ranking["name"] if results.is_ruled_out(str(name))}
    chosen = results.decision["chosen"]
    return tuple(FlightBlob(name, with_choice(blob, chosen, out, results.styles)) for name, blob in told.items())


def _joined(*sections: str) -> str:
    return "\n".join(one for one in sections if one)


def _decision_tab(read: _Read) -> str:
    results = read.results
    # the last one is the next steps, which have a section of their own
    words = bullets(results.decision["paragraphs"][:-1])
    return _joined(
        first_screen(results, answer_chart(results)),
        details("The decision in words", words),
        evidence_section(results),
        flight_by_flight_section(results),
        withheld_section(results),
        holds_section(results),
        truth_section(results),
        history_section(results.history),
        next_steps_section(results),
        _nothing_to_say(_untold_of_decision(results)),
    )


def _untold_of_decision(results: Results) -> Iterator[str]:
    if not results.flights:
        yield "No flight has a say, so there is nothing to compare the sets by."
    elif results.decision["leave_one_out"] is None:
        yield "With fewer than three flights that count none can be left out to see whether the choice holds."


def _flights_tab(read: _Read) -> str:
    return _joined(
        flights_section(read.results, read.logs, [blob.flight for blob in read.blobs]),
        viewer_section(read.blobs, read.logs, read.results.flights),
        conformance_section(read.results, read.missions),
        mission_section(read.mission),
        single_flights_section(read.results),
        _nothing_to_say(not_flown(read.missions)),
    )


def _parameters_tab(read: _Read) -> str:
    return _joined(sets_section(read.results), sensitivity_section(read.results))


def _health_tab(read: _Read) -> str:
    fleet = read.fleet
    together = "" if fleet is None else _joined(
        matrix_section(fleet), changes_section(fleet), outliers_section(fleet), verdicts_section(fleet)
    )  # fmt: skip
    return _joined(
        health_answer(read.logs),
        health_section(read.logs),
        together,
        advice_section(read.logs.verdicts.values()),
        "" if fleet is None else figures_section(fleet),
        "" if fleet is None else _nothing_to_say(untold(fleet)),
    )


def _sensors_tab(read: _Read) -> str:
    return _joined(
        findings_section(read.results),
        innovations_section(read.results),
        _nothing_to_say([HOW_TO_DRAW]),
    )


def _method_tab(read: _Read) -> str:
    return _joined(
        weights_section(read.results),
        trust_section(read.trust),
        paper_section(read.results),
        provenance_section(read.results),
    )


def _nothing_to_say(lines: Sequence[str] | Iterator[str]) -> str:
    """What these flights do not tell, a line each."""
    return bullets(list(lines), "untold")
