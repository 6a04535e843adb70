"""Pages of sensors, of one flight and of all: drawn when they are asked for, as pictures take longer than all else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from fusetune.analyze.flight_files import SENSOR_NOISE_FILE
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
    noise_files: Sequence[AnyPath], figure_folder: AnyPath, output: AnyPath, pages: Mapping[str, AnyPath] | None = None
) -> None:
    """Draw each sensor over the flights that it was on, and write their page as one HTML file.

    Parameters
    ----------
    noise_files : `results/analyze/<flight>/sensor_noise.json`, oldest flight first
    figure_folder : takes the figures
    output : `results/report/all_sensors.html`
    pages : words → other pages that it leads to
    """
    documents = [read_document(file) for file in noise_files]
    pooled = pooled_sensors([one for one in documents if one["sensors"]])
    parts = [page_links(pages or {}, output)]
    drawn = plot_pooled_sensors(pooled, figure_folder) if pooled else ()
    for one, picture in zip(pooled, drawn, strict=False):
        device = f", device {one.device_id}" if one.device_id else ""
        count = f"{len(one.flights)} flight{'s' if len(one.flights) != 1 else ''}"
        parts.append(section(f"{one.sensor.name}{device}, {count}", figure(picture, _POOLED)))
    # of all sensors together, behind theirs
    parts += [section("Allan deviation", figure(picture, _POOLED_ALLAN)) for picture in drawn[len(pooled) :]]
    if not pooled:
        parts.append(paragraph("No log's sensors could be read."))
    Path(output).parent.mkdir(parents=True, exist_ok=True)
    write_page(output, PageHead("All sensors", "All sensors, over all flights", "each device by itself"), parts)
