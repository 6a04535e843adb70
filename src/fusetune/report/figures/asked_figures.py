"""Figures that are asked for by name or by their number in the paper, drawn and written."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from fusetune.analyze.sensor_noise.sensor_series import SensorName
from fusetune.errors import UserError
from fusetune.report.figures.allan_figure import draw_allan
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
from fusetune.report.figures.sensor_figures import draw_sensor
from fusetune.report.figures.spectrum_figure import draw_spectra
from fusetune.report.figures.summary_figures import summary_drawings
from fusetune.report.results import Results
from fusetune.storage.files import AnyPath

Drawings = Mapping[str, Callable[[], Figure]]

_SENSORS: tuple[SensorName, ...] = ("gyro", "accel", "mag", "baro", "gnss_vel", "gnss_pos")
_PDF = "pdf"


def flight_drawings(flight: PlottedFlight, sets: Sequence[str], column: str) -> dict[str, Callable[[], Figure]]:
    """All that can be drawn of a flight, by name; the sensors' last, as they are characterised for it.

    Parameters
    ----------
    sets : whose curves are drawn; without any what flies now, what is chosen, and the vehicle's own filter
    column : of `COLUMNS`
    """
    width = COLUMNS[column]
    drawings: dict[str, Callable[[], Figure]] = {
        one.name: partial(one.draw, width) for one in flight_figures(flight, sets or flight.usual_sets)
    }

    def of_sensor(draw: Callable[[], Figure]) -> Callable[[], Figure]:
        return lambda: fitted_to_column(draw(), width)

    for name in _SENSORS:
        # which of them a flight has is known when it is characterised
        drawings[f"sensor_{name}"] = of_sensor(partial(_sensor, flight, name))
    drawings["allan"] = of_sensor(lambda: draw_allan(flight.noise))
    drawings["spectra"] = of_sensor(lambda: draw_spectra(flight.noise))
    return drawings


def results_drawings(results: Results, column: str) -> dict[str, Callable[[], Figure]]:
    """All that can be drawn of the flights that decide together, by name."""
    width = COLUMNS[column]

    def fitted(draw: Callable[[], Figure]) -> Callable[[], Figure]:
        return lambda: fitted_to_column(draw(), width)

    return {Path(name).stem: fitted(draw) for name, draw in summary_drawings(results).items()}


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
        return [name for name in drawings if not name.startswith("sensor_") and name not in ("allan", "spectra")]
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
