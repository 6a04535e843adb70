"""What the flight tells of single effects: values to set with intervals, or why it does not tell."""

from __future__ import annotations

from collections.abc import Mapping

from fusetune.report.counted import count_words
from fusetune.report.flight_results import Document, FlightResults
from fusetune.report.markup import Cell, details, number, paragraph, section, table, unit_cell
from fusetune.report.severity_words import worst_of

EFFECT_WORDS: Mapping[str, str] = {
    "drag": "drag of the airframe",
    "static_pressure": "static pressure against airspeed",
    "ground_effect": "barometer near the ground",
    "motor_magnetic_field": "magnetic field of the motors",
    "hard_iron": "hard iron",
    "magnetometer_scale": "scale of the magnetometer",
    "declination": "magnetic declination",
    "range_lever_arm": "place of the range finder",
    "range_noise": "noise of the range finder",
    "optical_flow": "optical flow",
    "flow_delay": "delay of the optical flow",
    "vision_lever_arm": "place of the camera",
    "airspeed_scale": "scale of the airspeed",
    "output_predictor": "output predictor",
    "imu_lever_arm": "place of the IMU",
    "gnss_antenna": "place of the GNSS antenna",
}


def effects_section(results: FlightResults) -> str:
    """Estimates in a table, refusals behind a click."""
    told = [
        (effect, one, effect["id"] if place == 0 else "")
        for effect in results.effects
        for place, one in enumerate(effect["estimates"])
    ]
    refused = [effect for effect in results.effects if effect["refusal"]]
    parts = []
    if told:
        text = (
            "Each with its 95 % interval. A value whose interval holds what flies now is no reason to change it. One "
            "flight's value is to be tried like any other set before it is kept."
        )
        head = ("effect", "parameter", "flies now", "flight says", "interval", "unit", "what to make of it")
        if worst_of(list(results.diagnoses)) in ("fail", "warning"):
            text += " Mend first what is wrong: what is broken spoils these values, too."
        parts += [paragraph(text), table(head, [_estimate_row(*one) for one in told])]
    elif results.effects:
        parts.append(paragraph("This flight tells none of them: what it takes to tell stands below."))
    else:
        return ""
    if refused:
        rows = [(_words(one["id"]), str(one["refusal"])) for one in refused]
        count = f"{count_words(len(rows), 'effect')} that this flight does not tell, and what to fly"
        parts.append(details(count, table(("effect", "why not, and what to fly"), rows)))
    return section("What could be set from this flight", *parts, id="effects")


def _words(effect: str) -> str:
    return EFFECT_WORDS.get(effect, effect.replace("_", " ")) if effect else ""


def _estimate_row(_: Document, estimate: Document, effect: str) -> tuple[Cell | str, ...]:
    lower, upper, told = estimate["lower"], estimate["upper"], estimate["told"]
    return (
        _words(effect),
        Cell(str(estimate["name"]), "mono"),
        number(told),
        number(estimate["value"]),
        Cell(f"{number(lower).text} to {number(upper).text}", "short"),
        unit_cell(str(estimate["unit"])),
        _advice(told, lower, upper, estimate["value"]),
    )


def _advice(told: float | None, lower: float, upper: float, value: float) -> Cell:
    if told is None:
        return Cell("measured; no parameter says it", "quiet")
    if lower <= told <= upper:
        return Cell("agrees with what flies", "good")
    return Cell(f"try {number(value).text}", "is-warning")
