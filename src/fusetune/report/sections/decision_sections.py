"""The parts of the page about what to fly and what was compared."""

from html import escape
from typing import Any

from fusetune.px4.parameters.ekf2_parameters import PARAMETERS
from fusetune.report.markup import Cell, number, paragraph, section, table
from fusetune.report.results import Results
from fusetune.report.sections.ranking_tables import set_name
from fusetune.report.sections.truth_section import truth_sentence

_HEADINGS = {"change": "Change to “{chosen}”", "keep": "Keep what flies now", "no_evidence": "Keep what flies now"}


def decision_section(results: Results) -> str:
    """The decision in a box, with what changes and how to load it."""
    decision = results.decision
    status = decision["status"]
    heading = escape(_HEADINGS[status].format(chosen=decision["chosen"]))
    tag = '<span class="tag">exploratory</span>' if decision["exploratory"] else ""
    parts = [f'<section class="decision {escape(status)}"><h2>{heading}{tag}</h2>']
    # the last one is the next steps, which have a section of their own
    parts += [paragraph(matter) for matter in decision["paragraphs"][:-1]]
    truth = truth_sentence(results)
    parts.append(paragraph(truth) if truth else "")
    parts.append(_vehicle(decision["vehicle"]))
    if decision["changes"]:
        rows = [_change_row(change) for change in decision["changes"]]
        parts.append(table(("parameter", "now", "new", "unit", ""), rows))
    if decision["on_vehicle"]["parameters"]:
        parts.append(
            paragraph(
                "Load results/apply/best_params.params in QGroundControl (Parameters → Tools → Load from file), "
                "reboot, and fly a short, safe flight first. results/apply/rollback.params brings the old values back. "
                "The same for other tools lies beside them: .parm for MAVProxy, .sh for PX4's shell, replay_params.txt "
                "for PX4's own replay.",
                "note",
            )
        )
    else:
        parts.append(paragraph("There is nothing to load: best_params.params holds no parameter and says so.", "note"))
    return "".join(parts) + "</section>"


def _vehicle(vehicle: dict[str, Any] | None) -> str:
    """Who is decided for, and from which flight it is known what flies now."""
    if vehicle is None:
        return ""
    text = f"Vehicle: {vehicle['in_words']}. What flies now is what {vehicle['present_flight']} ended with."
    if vehicle["kind"] == "real" and not vehicle["uuid"]:
        text += " Its logs do not name the board: all of this hardware and airframe are taken for one vehicle."
    if vehicle["left_out"]:
        text += (
            " Flights of other vehicles were replayed and graded as well, the present set with this vehicle's values; "
            "they do not decide."
        )
    return paragraph(text, "note")


def _change_row(change: dict[str, Any]) -> tuple[Cell, ...]:
    reboot = "after a reboot" if change["reboot_required"] else ""
    return (
        Cell(change["name"], "mono"),
        number(change["previous"], 6),
        number(change["value"], 6),
        Cell(change["unit"]),
        Cell(reboot, "quiet"),
    )


def sets_section(results: Results) -> str:
    """What each set changes, and where that could act."""
    sets = {one["set"]: one for one in results.decision["sets"]}
    parameters = sorted({name for one in sets.values() for name in one["overrides"]})
    now = _present_parameters(results)
    rows = []
    for parameter in parameters:
        row = [Cell(parameter, "mono"), Cell(_unit(parameter), "quiet")]
        for name in results.shown:
            value = sets[name]["overrides"].get(parameter)
            kind = "number quiet" if value is None else "number"
            row.append(number(now.get(parameter) if value is None else value, 6, kind))
        rows.append(row)
    parts = [table(("parameter", "unit", *results.shown), rows, "Values; grey: as the vehicle has it now")]
    described = [(set_name(name, results), one["description"]) for name, one in sets.items() if one["description"]]
    if described:
        parts.append(table(("set", "description"), described))
    inactive = _inactive(results.decision["sets"])
    if inactive:
        parts += [paragraph("Parameters that could not act:"), table(("set", "parameter", "why", "flights"), inactive)]
    return section("The parameter sets", *parts)


def _present_parameters(results: Results) -> dict[str, float]:
    newest = results.decision["newest_flight"]
    return results.scoring[newest]["sets"][results.present]["parameters"] if newest else {}


def _unit(name: str) -> str:
    return PARAMETERS[name].unit if name in PARAMETERS else ""


def _inactive(sets: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    rows: dict[tuple[str, str], list[tuple[str, str]]] = {}

    def more(found: list[tuple[str, str]]) -> str:
        return " …" if len(found) > 3 else ""

    for one in sets:
        for flight, reasons in one["inactive"].items():
            for parameter, why in reasons.items():
                if not why.startswith("has the same value"):
                    rows.setdefault((one["set"], parameter), []).append((flight, why))
    return [
        (name, parameter, found[0][1], f"{len(found)}: " + ", ".join(flight for flight, _ in found[:3]) + more(found))
        for (name, parameter), found in sorted(rows.items())
    ]
