"""Figures that are asked for by name or by their number in the paper, drawn and written."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from fusetune.analyze.conformance.track_file import read_track
from fusetune.analyze.flight_files import CONFORMANCE_FILE, SCORING_FILE, TRACK_FILE
from fusetune.analyze.sensor_noise.sensor_series import SensorName
from fusetune.errors import UserError
from fusetune.report.figures.allan_figure import draw_allan
from fusetune.report.figures.conformance_figure import draw_conformance
from fusetune.report.figures.fleet_figures import draw_trends
from fusetune.report.figures.flight_figures import overview_figure
from fusetune.report.figures.flight_panel_figures import flight_figures
from fusetune.report.figures.paper_figures import PAPER_FIGURES
from fusetune.report.figures.plotted_flight import PlottedFlight
from fusetune.report.figures.publication import (
    COLUMNS,
    fitted_to_column,
    publication_style,
    save_figure,
    save_pages,
)
from fusetune.report.figures.search_figures import search_drawings
from fusetune.report.figures.sensor_figures import draw_sensor
from fusetune.report.figures.spectrum_figure import draw_spectra
from fusetune.report.figures.summary_figures import summary_drawings
from fusetune.report.figures.timeline_figure import TIMELINE_TOPICS, draw_timeline
from fusetune.report.finding_bars import finding_bars
from fusetune.report.fleet.fleet_results import FleetResults
from fusetune.report.fleet.shown_figures import trend_columns
from fusetune.report.flight_results import read_flight_results
from fusetune.report.results import Results
from fusetune.report.search_results import SearchResults
from fusetune.save.flight_folder import load_flight
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath

Drawings = Mapping[str, Callable[[], Figure]]

_SENSORS: tuple[SensorName, ...] = ("gyro", "accel", "mag", "baro", "gnss_vel", "gnss_pos")
_WHEN_ASKED = ("sensor_", "allan", "spectra")
"""Takes long."""
_PDF = "pdf"
_PANELS = {"single": 1, "double": 2}
"""Side by side."""


def flight_drawings(flight: PlottedFlight, sets: Sequence[str], column: str) -> dict[str, Callable[[], Figure]]:
    """All that can be drawn of a flight, by name; the sensors' last, as they are characterised for it.

    Parameters
    ----------
    sets : whose curves are drawn; without any what flies now, what is chosen, and the vehicle's own filter
    column : of `COLUMNS`
    """
    width, columns = COLUMNS[column], _PANELS[column]
    drawings: dict[str, Callable[[], Figure]] = {
        one.name: partial(one.draw, width) for one in flight_figures(flight, sets or flight.usual_sets)
    }

    # which sensors a flight has is known when they are characterised
    others: dict[str, Callable[[], Figure]] = {f"sensor_{name}": partial(_sensor, flight, name) for name in _SENSORS}
    others |= {
        "allan": lambda: draw_allan(flight.noise, columns),
        "spectra": lambda: draw_spectra(flight.noise),
    }
    if flight.folders is not None:
        others |= _of_folders(*flight.folders)
    return drawings | _fitted(others, column)


def _of_folders(saved: Path, folder: Path) -> dict[str, Callable[[], Figure]]:
    """What is drawn of a flight that the pipeline analysed."""
    found: dict[str, Callable[[], Figure]] = {
        "timeline": lambda: draw_timeline(
            load_flight(saved, topics=TIMELINE_TOPICS), tuple(finding_bars(read_flight_results(folder)))
        )
    }
    if (folder / SCORING_FILE).exists():
        scoring = read_document(folder / SCORING_FILE)
        names, present = list(scoring["sets"]), scoring["present"]
        found["overview"] = lambda: overview_figure(saved, folder, names, present=present)
    track = read_track(folder / TRACK_FILE)
    if track is not None and track.has_place:
        found["map"] = lambda: draw_conformance(track, read_document(folder / CONFORMANCE_FILE))
    return found


def results_drawings(results: Results, fleet: FleetResults | None, column: str) -> Drawings:
    """All that can be drawn of the flights that decide together, by name, and of all flights where they are given."""
    drawings = summary_drawings(results)
    if fleet is not None and (columns := trend_columns(fleet)):
        drawings["trends"] = partial(draw_trends, fleet.table, columns, fleet.changes)
    return _fitted(drawings, column)


def search_figures(results: SearchResults, column: str) -> Drawings:
    """All that can be drawn of a search, by name."""
    return _fitted(search_drawings(results), column)


def _fitted(drawings: Drawings, column: str) -> dict[str, Callable[[], Figure]]:
    """As drawn for the screen, no wider than a column."""

    def narrowed(draw: Callable[[], Figure]) -> Callable[[], Figure]:
        return lambda: fitted_to_column(draw(), COLUMNS[column])

    return {name: narrowed(draw) for name, draw in drawings.items()}


def _sensor(flight: PlottedFlight, name: SensorName) -> Figure:
    if name not in flight.noise.sensors:
        raise UserError(flight.name, f"its log holds no samples of {name}", "Ask for another figure")
    return draw_sensor(flight.noise, name)


def write_figures(
    drawings: Drawings, asked: Sequence[str], kind: str, folder: AnyPath, pages: str = ""
) -> tuple[Path, ...]:
    """Draw, and write a file for each figure, or one with a page for each.

    Parameters
    ----------
    drawings : what there is
    asked : names of figures, or their numbers in the paper; all but the sensors' without any
    kind : of `fusetune.report.figures.publication.FORMATS`
    folder : is made where it does not exist
    pages : name of the PDF that all go into where none is asked for by name; "" for a file each

    Raises
    ------
    UserError
        A figure is asked for that there is none of.
    """
    names = _names(drawings, asked)
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    with publication_style():
        if pages and kind == _PDF and not asked:
            file = target / f"{pages}.pdf"
            save_pages([drawings[name]() for name in names], file)
            return (file,)
        files = tuple(target / f"{name}.{kind}" for name in names)
        for name, file in zip(names, files, strict=True):
            save_figure(drawings[name](), file)
        return files


def _names(drawings: Drawings, asked: Sequence[str]) -> list[str]:
    if not asked:
        return [name for name in drawings if not name.startswith(_WHEN_ASKED)]
    found: list[str] = []
    for one in asked:
        told = PAPER_FIGURES.get(int(one), ()) if one.isdecimal() else (one,)
        parts = [name for name in drawings for asked_for in told if _is_part(name, asked_for)]
        if not parts:
            reason = f"there is none of {', '.join(told)} here" if told else "the paper's figures are 5 to 20"
            raise UserError(f"--figure {one}", reason, f"There is: {', '.join(drawings)}")
        found += parts
    return list(dict.fromkeys(found))


def _is_part(name: str, asked: str) -> bool:
    """Whether a figure is the one asked for, or one that it goes on in."""
    return name == asked or (name.startswith(f"{asked}_") and name[len(asked) + 1 :].isdecimal())
