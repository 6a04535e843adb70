"""What was compared: the values of each set, and where they could act."""

from typing import Any

from fusetune.px4.parameters.ekf2_parameters import PARAMETERS
from fusetune.report.counted import count_words, listed
from fusetune.report.markup import Cell, details, number, section, table
from fusetune.report.results import Results
from fusetune.report.sections.ranking_tables import set_name


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
    parts = [table(("parameter", "unit", *results.shown), rows, footer="In grey: as the vehicle has it now.")]
    described = [(set_name(name, results), one["description"]) for name, one in sets.items() if one["description"]]
    parts.append(details("What each set is", table(("set", "description"), described)))
    inactive = _inactive(results.decision["sets"])
    parts.append(
        details(
            f"{count_words(len(inactive), 'value')} that could not act, and why",
            table(("parameter", "why", "sets", "flights"), inactive),
        )
    )
    return section("The parameter sets", *parts, id="sets")


def _present_parameters(results: Results) -> dict[str, float]:
    newest = results.decision["newest_flight"]
    return results.scoring[newest]["sets"][results.present]["parameters"] if newest else {}


def _unit(name: str) -> str:
    return PARAMETERS[name].unit if name in PARAMETERS else ""


def _inactive(sets: list[dict[str, Any]]) -> list[tuple[Cell | str, ...]]:
    """A row for each parameter and reason, with the sets and flights that it holds for."""
    found: dict[tuple[str, str], tuple[dict[str, None], dict[str, None]]] = {}
    for one in sets:
        for flight, reasons in one["inactive"].items():
            for parameter, why in reasons.items():
                if not why.startswith("has the same value"):
                    named = found.setdefault((parameter, why), ({}, {}))
                    named[0][one["set"]] = named[1][flight] = None
    return [
        (Cell(parameter, "mono"), why, listed(list(names)), f"{len(flights)}: {listed(list(flights))}")
        for (parameter, why), (names, flights) in sorted(found.items())
    ]
