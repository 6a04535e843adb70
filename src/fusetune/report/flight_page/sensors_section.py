"""The sensors of a flight: the noise parameters to begin with, and pictures of each sensor."""

from __future__ import annotations

from pathlib import Path

from fusetune.report.flight_page.flight_results import Document
from fusetune.report.markup import Cell, details, figure, number, paragraph, section, table, unit_cell
from fusetune.storage.files import AnyPath

_PICTURES = {
    "allan.svg": (
        "Allan deviation",
        "From times of standing still: noise density at 1 s, bias instability at the flat part, random walk on the "
        "right.",
    ),
    "spectra.svg": ("Spectra", "At rest and in flight; peaks in step with the motors are named."),
}
_HOW_TO_DRAW = (
    "Pictures of each sensor (samples, boxes, histograms, Allan deviation, spectra): snakemake --cores 2 sensors draws "
    "them into results/report/sensors/."
)
_OF_SENSOR = "Samples with outliers marked, boxes per axis, histogram, and quantiles against a normal distribution."


def sensors_section(noise: Document, figure_folder: AnyPath) -> str:
    """What `sensor_noise.json` says and what was drawn of it; empty where neither says anything.

    Parameters
    ----------
    noise : that document
    figure_folder : with what `plot_sensor_noise` drew; what is missing there is left out
    """
    figures = Path(figure_folder)
    parts = []
    limited = noise["vibration_limited"]
    if limited:
        text = f"Vibration, not the sensor, makes the noise in flight of: {', '.join(limited)}."
        parts.append(paragraph(text + " Less vibration tells more than another parameter."))
    if noise["starting"]:
        head = ("parameter", "unit", "flies now", "at rest", "in flight", "start with")
        parts.append(paragraph("Noise parameters to start a study with, from what the sensors do:"))
        parts.append(table(head, [_starting_row(one) for one in noise["starting"]]))
        reasons = [(Cell(str(one["parameter"]), "mono"), str(one["words"])) for one in noise["starting"]]
        parts.append(details("Why these", table(("parameter", "why"), reasons)))
    for name, (title, caption) in _PICTURES.items():
        if (figures / name).exists():
            parts.append(details(title, figure(figures / name, caption)))
    for name, sensor in noise["sensors"].items():
        picture = figures / f"sensor_{name}.png"
        if picture.exists():
            parts.append(details(f"{sensor['sensor']}: {sensor['topic']}", figure(picture, _OF_SENSOR)))
    if parts and not any((figures / name).exists() for name in _PICTURES):
        parts.append(paragraph(_HOW_TO_DRAW, "note"))
    return section("The sensors themselves", *parts) if parts else ""


def _starting_row(one: Document) -> tuple[Cell | str, ...]:
    start = number(one["start_with"])
    changed = abs(one["start_with"] - one["flown"]) > 1e-6 * abs(one["flown"])
    return (
        Cell(str(one["parameter"]), "mono"),
        unit_cell(str(one["unit"])),
        number(one["flown"]),
        number(one["at_rest"]),
        number(one["in_flight"]),
        Cell(start.text, "number is-warning" if changed else "number"),
    )
