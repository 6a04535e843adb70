"""Pages of sensors, of one flight and of all: drawn when they are asked for, as pictures take longer than all else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fusetune.analyze.flight_files import HEALTH_FILE, SENSOR_NOISE_FILE
from fusetune.analyze.sensor_noise.pooled import pooled_sensors
from fusetune.analyze.sensor_noise.sensor_noise import SensorNoise, sensor_noise_of
from fusetune.report.charts.sensors import (
    allan_chart,
    pooled_allan_chart,
    pooled_sensor_chart,
    sensor_chart,
    spectra_chart,
)
from fusetune.report.counted import count_words
from fusetune.report.flight_names import short_names
from fusetune.report.flight_page.sensors_section import sensors_section
from fusetune.report.markup import details, paragraph, section
from fusetune.report.page_shell.shell import PageHead, Tab, page_links, write_page
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath


def build_sensor_page(
    flight_folder: AnyPath,
    analyze_folder: AnyPath,
    output: AnyPath,
    pages: Mapping[str, AnyPath] | None = None,
) -> None:
    """Draw the sensors of a saved flight and write their page as one HTML file.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    analyze_folder : `results/analyze/<flight>` with `sensor_noise.json`
    output : `results/report/sensors/<flight>.html`
    pages : words → other pages that it leads to

    Raises
    ------
    UserError
        The saved flight or the document is missing or damaged.
    """
    told = read_document(Path(analyze_folder) / SENSOR_NOISE_FILE)
    pictures = _pictures(sensor_noise_of(flight_folder), told["sensors"]) if told["sensors"] else ""
    html = sensors_section(told, pictures) or paragraph("Nothing of this log's sensors could be read.")
    heading = f"{told['flight']}: its sensors"
    head = PageHead(heading, heading, "at rest and in flight", page_links(pages or {}, output))
    Path(output).parent.mkdir(parents=True, exist_ok=True)
    write_page(output, head, [Tab("sensors", "Sensors", html)])


def _pictures(noise: SensorNoise, told: Mapping[str, Mapping[str, Any]]) -> str:
    drawn = {"Allan deviation": allan_chart(noise), "Spectra": spectra_chart(noise)}
    for name in noise.sensors:
        one = told[name]
        drawn[f"{one['sensor']}: {one['topic']}"] = sensor_chart(noise, name)
    return "".join(details(title, picture) for title, picture in drawn.items())


def build_pooled_sensor_page(
    flight_folders: Sequence[AnyPath],
    output: AnyPath,
    pages: Mapping[str, AnyPath] | None = None,
) -> None:
    """Draw each sensor of each vehicle over the flights that it was on, and write their page as one HTML file.

    Parameters
    ----------
    flight_folders : `results/analyze/<flight>` with `sensor_noise.json` and `health.json`, oldest flight first
    output : `results/report/all_sensors.html`
    pages : words → other pages that it leads to
    """
    # the ids of devices are those of bus and address, so vehicles share them
    by_vehicle: dict[str, list[dict[str, Any]]] = {}
    for folder in map(Path, flight_folders):
        told = read_document(folder / SENSOR_NOISE_FILE)
        if told["sensors"]:
            by_vehicle.setdefault(read_document(folder / HEALTH_FILE)["vehicle"], []).append(told)
    parts = [_of_vehicle(vehicle or "Unknown vehicle", documents) for vehicle, documents in by_vehicle.items()]
    html = "".join(parts) or paragraph("No log's sensors could be read.")
    names = short_names(one["flight"] for documents in by_vehicle.values() for one in documents)
    head = PageHead(
        "All sensors", "All sensors, over all flights", "each device by itself", page_links(pages or {}, output)
    )
    Path(output).parent.mkdir(parents=True, exist_ok=True)
    write_page(output, head, [Tab("sensors", "Sensors", html)], names=names)


def _of_vehicle(vehicle: str, documents: Sequence[Mapping[str, Any]]) -> str:
    pooled = pooled_sensors(documents)
    parts = []
    for one in pooled:
        device = f", device {one.device_id}" if one.device_id else ""
        title = f"{one.sensor.label}{device}, {count_words(len(one.flights), 'flight')}"
        parts.append(details(title, pooled_sensor_chart(one)))
    parts.append(details("Allan deviation", pooled_allan_chart(pooled)))
    return section(vehicle, *parts)
