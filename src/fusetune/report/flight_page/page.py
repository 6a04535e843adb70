"""Puts the page of a flight together: one file that needs no network."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path

from fusetune.analyze.conformance.track_file import read_track
from fusetune.analyze.flight_files import CONFORMANCE_FILE, SENSOR_NOISE_FILE, TRACK_FILE
from fusetune.report.flight_page.answer import answer_section, causes_section
from fusetune.report.flight_page.conformance_section import conformance_section
from fusetune.report.flight_page.effects_section import effects_section
from fusetune.report.flight_page.health_table import health_table_section
from fusetune.report.flight_page.sensors_section import sensors_section
from fusetune.report.flight_results import FlightResults, read_flight_results
from fusetune.report.markup import section
from fusetune.report.page_shell.shell import VIEWER_CLASS, FlightBlob, PageHead, Tab, page_links, write_page
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath


def build_flight_page(
    analyze_folder: AnyPath, output: AnyPath, pages: Mapping[str, AnyPath] | None = None, blob: bytes | None = None
) -> None:
    """Write the page of a flight as one HTML file.

    Parameters
    ----------
    analyze_folder : `results/analyze/<flight>` with `health.json`, `diagnosis.json` and `effects.json`, and
        `conformance.json` and `sensor_noise.json` where it was compared and its sensors are characterised
    output : `results/report/flights/<flight>.html`
    pages : words → other pages that it leads to, as `{"The decision": "results/report.html"}`
    blob : what the viewer shows of the flight (`fusetune.report.flight_data`); none where nothing of it could be read

    Raises
    ------
    UserError
        A document is missing or damaged.
    """
    results = read_flight_results(analyze_folder)
    noise, conformance = (Path(analyze_folder) / name for name in (SENSOR_NOISE_FILE, CONFORMANCE_FILE))
    mount = f'<div class="{VIEWER_CLASS}" data-flight="{escape(results.flight)}"></div>'
    sections = (
        answer_section(results, bool(blob)),
        causes_section(results, bool(blob)),
        section("The flight over time", mount, id="viewer") if blob else "",
        _flown(conformance, Path(analyze_folder) / TRACK_FILE),
        effects_section(results),
        health_table_section(results),
        sensors_section(read_document(noise)) if noise.exists() else "",
    )
    told = (_known(results.vehicle, "vehicle"), _firmware(results), results.mission,
            results.date.replace("T", " ").replace("Z", " UTC"))  # fmt: skip
    head = PageHead(
        results.flight, results.flight, " · ".join(one for one in told if one), page_links(pages or {}, output)
    )
    Path(output).parent.mkdir(parents=True, exist_ok=True)
    blobs = [FlightBlob(results.flight, blob)] if blob else []
    write_page(output, head, [Tab("flight", "Flight", "\n".join(filter(None, sections)))], blobs)


def _flown(conformance: Path, track: Path) -> str:
    if not conformance.exists():
        return ""
    return conformance_section(read_document(conformance), read_track(track) if track.exists() else None)


def _firmware(results: FlightResults) -> str:
    """What flew, and whose estimator replays it where there is a replay."""
    flew = _known(results.firmware, "firmware")
    if results.refusals or not results.is_readable or not results.replayed_as:
        return flew
    return f"{flew}, replayed as {results.replayed_as}{f' ({results.replayed_why})' if results.replayed_why else ''}"


def _known(name: str, what: str) -> str:
    return f"unknown {what}" if name in ("", "unknown") else name
