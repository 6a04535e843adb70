"""Puts the page of a flight together: one file that needs no network."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from fusetune.analyze.conformance.track_file import read_track
from fusetune.analyze.flight_files import CONFORMANCE_FILE, SENSOR_NOISE_FILE, TRACK_FILE
from fusetune.report.figure_words import figure_words
from fusetune.report.figures.conformance_figure import draw_conformance
from fusetune.report.figures.drawing import figure_style, save_png
from fusetune.report.figures.timeline_figure import TIMELINE_TOPICS, Bar, draw_timeline
from fusetune.report.flight_page.answer import answer_section, causes_section
from fusetune.report.flight_page.conformance_section import conformance_section
from fusetune.report.flight_page.effects_section import effects_section
from fusetune.report.flight_page.flight_results import FlightResults, read_flight_results
from fusetune.report.flight_page.health_table import health_table_section
from fusetune.report.flight_page.sensors_section import sensors_section
from fusetune.report.html_page import PageHead, page_links, write_page
from fusetune.report.markup import figure, section
from fusetune.report.severity_words import cause_words
from fusetune.save.flight_folder import METADATA_FILE, load_flight, read_flight_document
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath

TIMELINE_FILE = "timeline.png"
MAP_FILE = "map.png"

_MOST_ROWS_DRAWN = 8
_LONGEST_LABEL = 46
_TIMELINE = (
    "Bold: causes, thin: figures beyond their limits, over the part of the flight that they are about. Grey: on the "
    "ground. The dashed line is the gate: beyond it the filter rejects a sample."
)


def plot_flight_timeline(flight_folder: AnyPath, analyze_folder: AnyPath, output: AnyPath) -> None:
    """Draw when what was found on a flight.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    analyze_folder : `results/analyze/<flight>` with `health.json`, `diagnosis.json` and `effects.json`
    output : the picture, `TIMELINE_FILE` in the folder of the flight's figures

    Raises
    ------
    UserError
        The saved flight or a document is missing or damaged.
    """
    results = read_flight_results(analyze_folder)
    logged = load_flight(flight_folder, topics=TIMELINE_TOPICS)
    Path(output).parent.mkdir(parents=True, exist_ok=True)
    with figure_style():
        save_png(draw_timeline(logged, tuple(_bars(results))), output)


def plot_flight_map(analyze_folder: AnyPath, output: AnyPath) -> None:
    """Draw where it was flown, over its mission; nothing where no place on earth is known.

    Parameters
    ----------
    analyze_folder : `results/analyze/<flight>` with `track.parquet` and `conformance.json`
    output : the picture, `MAP_FILE` in the folder of the flight's figures

    Raises
    ------
    UserError
        A file is missing or damaged.
    """
    track = read_track(Path(analyze_folder) / TRACK_FILE)
    if track is None or not track.has_place:
        return
    document = read_document(Path(analyze_folder) / CONFORMANCE_FILE)
    Path(output).parent.mkdir(parents=True, exist_ok=True)
    with figure_style():
        save_png(draw_conformance(track, document), output)


def _bars(results: FlightResults) -> Iterator[Bar]:
    for one in results.diagnoses:
        yield Bar(cause_words(one["id"]), one["severity"], one["since_s"], one["until_s"])
    timed = [(row, when) for row in results.problem_subjects if (when := results.since_start_s(row)) is not None]
    for row, when in timed[:_MOST_ROWS_DRAWN]:
        yield Bar(_shortened(figure_words(row["id"])), row["severity"], *when, is_cause=False)


def _shortened(words: str) -> str:
    return words if len(words) <= _LONGEST_LABEL else words[: _LONGEST_LABEL - 1].rstrip() + "…"


def build_drawn_flight_page(
    flight_folder: AnyPath,
    analyze_folder: AnyPath,
    figure_folder: AnyPath,
    output: AnyPath,
    pages: Mapping[str, AnyPath] | None = None,
) -> None:
    """Draw when what was found on a saved flight, where anything of it could be read, and write its page.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    analyze_folder, output, pages : as of `build_flight_page`
    figure_folder : takes the figures
    """
    if "topics" in read_flight_document(Path(flight_folder) / METADATA_FILE):
        plot_flight_timeline(flight_folder, analyze_folder, Path(figure_folder) / TIMELINE_FILE)
        plot_flight_map(analyze_folder, Path(figure_folder) / MAP_FILE)
    build_flight_page(analyze_folder, figure_folder, output, pages)


def build_flight_page(
    analyze_folder: AnyPath, figure_folder: AnyPath, output: AnyPath, pages: Mapping[str, AnyPath] | None = None
) -> None:
    """Write the page of a flight as one HTML file with its figures inside.

    Parameters
    ----------
    analyze_folder : `results/analyze/<flight>` with `health.json`, `diagnosis.json` and `effects.json`, and
        `conformance.json` and `sensor_noise.json` where it was compared and its sensors are characterised
    figure_folder : with `TIMELINE_FILE` and what `plot_sensor_noise` drew; a picture that is missing is left out
    output : `results/report/flights/<flight>.html`
    pages : words → other pages that it leads to, as `{"All flights": "results/fleet.html"}`

    Raises
    ------
    UserError
        A document is missing or damaged.
    """
    results = read_flight_results(analyze_folder)
    figures, noise = Path(figure_folder), Path(analyze_folder) / SENSOR_NOISE_FILE
    timeline, conformance = figures / TIMELINE_FILE, Path(analyze_folder) / CONFORMANCE_FILE
    sections = (
        page_links(pages or {}, output),
        answer_section(results),
        section("The flight", figure(timeline, _TIMELINE)) if timeline.exists() else "",
        causes_section(results),
        conformance_section(read_document(conformance), figures / MAP_FILE) if conformance.exists() else "",
        effects_section(results),
        health_table_section(results),
        sensors_section(read_document(noise), figures) if noise.exists() else "",
    )
    told = (_known(results.vehicle, "vehicle"), _known(results.firmware, "firmware"), results.mission,
            results.date.replace("T", " ").replace("Z", " UTC"))  # fmt: skip
    Path(output).parent.mkdir(parents=True, exist_ok=True)
    write_page(output, PageHead(results.flight, results.flight, ", ".join(one for one in told if one)), sections)


def _known(name: str, what: str) -> str:
    return f"unknown {what}" if name in ("", "unknown") else name
