"""Pages of sensors, of one flight and of all: drawn when they are asked for, as pictures take longer than all else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fusetune.analyze.flight_files import HEALTH_FILE, SENSOR_NOISE_FILE
from fusetune.analyze.sensor_noise.pooled import pooled_sensors
from fusetune.analyze.sensor_noise.sensor_noise import sensor_noise_of
from fusetune.report.figures.noise_figures import plot_pooled_sensors, plot_sensor_noise
from fusetune.report.flight_page.sensors_section import sensors_section
from fusetune.report.html_page import PageHead, page_links, write_page
from fusetune.report.markup import figure, paragraph, section
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath

_POOLED = "Boxes of each flight, at rest and in flight, and the histogram of all in standard deviations."
_POOLED_ALLAN = "From all times of standing still: noise density, bias instability, random walk."


def build_sensor_page(
    flight_folder: AnyPath,
    analyze_folder: AnyPath,
    figure_folder: AnyPath,
    output: AnyPath,
    pages: Mapping[str, AnyPath] | None = None,
) -> None:
    """Draw the sensors of a saved flight and write their page as one HTML file.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    analyze_folder : `results/analyze/<flight>` with `sensor_noise.json`
    figure_folder : takes the figures
    output : `results/report/sensors/<flight>.html`
    pages : words → other pages that it leads to

    Raises
    ------
    UserError
        The saved flight or the document is missing or damaged.
    """
    told = read_document(Path(analyze_folder) / SENSOR_NOISE_FILE)
    if told["sensors"]:
        plot_sensor_noise(sensor_noise_of(flight_folder), figure_folder)
    nothing = paragraph("Nothing of this log's sensors could be read.")
    sections = (page_links(pages or {}, output), sensors_section(told, figure_folder) or nothing)
    Path(output).parent.mkdir(parents=True, exist_ok=True)
    write_page(output, PageHead(told["flight"], f"{told['flight']}: its sensors", "at rest and in flight"), sections)


def build_pooled_sensor_page(
    flight_folders: Sequence[AnyPath],
    figure_folder: AnyPath,
    output: AnyPath,
    pages: Mapping[str, AnyPath] | None = None,
) -> None:
    """Draw each sensor of each vehicle over the flights that it was on, and write their page as one HTML file.

    Parameters
    ----------
    flight_folders : `results/analyze/<flight>` with `sensor_noise.json` and `health.json`, oldest flight first
    figure_folder : takes the figures
    output : `results/report/all_sensors.html`
    pages : words → other pages that it leads to
    """
    # the ids of devices are those of bus and address, so vehicles share them
    by_vehicle: dict[str, list[dict[str, Any]]] = {}
    for folder in map(Path, flight_folders):
        told = read_document(folder / SENSOR_NOISE_FILE)
        if told["sensors"]:
            by_vehicle.setdefault(read_document(folder / HEALTH_FILE)["vehicle"], []).append(told)
    parts = [page_links(pages or {}, output)]
    for number, (vehicle, documents) in enumerate(by_vehicle.items()):
        parts += _of_vehicle(vehicle or "Unknown vehicle", documents, Path(figure_folder) / str(number))
    if not by_vehicle:
        parts.append(paragraph("No log's sensors could be read."))
    Path(output).parent.mkdir(parents=True, exist_ok=True)
    write_page(output, PageHead("All sensors", "All sensors, over all flights", "each device by itself"), parts)


def _of_vehicle(vehicle: str, documents: Sequence[Mapping[str, Any]], figures: Path) -> list[str]:
    pooled = pooled_sensors(documents)
    drawn = plot_pooled_sensors(pooled, figures)
    parts = []
    for one, picture in zip(pooled, drawn, strict=False):
        device = f", device {one.device_id}" if one.device_id else ""
        count = f"{len(one.flights)} flight{'s' if len(one.flights) != 1 else ''}"
        parts.append(section(f"{vehicle}: {one.sensor.label}{device}, {count}", figure(picture, _POOLED)))
    # of all sensors together, behind theirs
    parts += [section(f"{vehicle}: Allan deviation", figure(one, _POOLED_ALLAN)) for one in drawn[len(pooled) :]]
    return parts
