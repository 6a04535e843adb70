"""The sensors of a flight: the noise parameters to begin with, and pictures of each sensor."""

from __future__ import annotations

from fusetune.report.flight_results import Document
from fusetune.report.markup import Cell, details, number, paragraph, section, table, unit_cell

HOW_TO_DRAW = (
    "Each sensor drawn (samples, boxes, histograms, Allan deviation, spectra): snakemake --cores 2 sensors writes "
    "results/report/sensors/."
)


def sensors_section(noise: Document, pictures: str = "") -> str:
    """What `sensor_noise.json` says; empty where it says nothing.

    Parameters
    ----------
    noise : that document
    pictures : of the sensors, HTML
    """
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
    parts.append(pictures)
    if any(parts) and not pictures:
        parts.append(paragraph(HOW_TO_DRAW, "note"))
    return section("The sensors themselves", *parts, id="sensors")


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
