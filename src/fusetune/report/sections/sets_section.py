"""What was compared: the values of each set, and where they could act."""

import math
from typing import Any

from fusetune.px4.parameters.ekf2_parameters import PARAMETERS
from fusetune.report.counted import count_words, listed
from fusetune.report.markup import Cell, CellLike, details, number, section, table, unit_cell
from fusetune.report.results import Results
from fusetune.report.sections.ranking_tables import set_name


def sets_section(results: Results) -> str:
    """What each set changes, and where that could act."""
    sets = {one["set"]: one for one in results.decision["sets"]}
    parameters = sorted({name for one in sets.values() for name in one["overrides"]})
    now = _present_parameters(results)
    rows: list[list[CellLike]] = []
    alike: list[str] = []
    for parameter in parameters:
        flown = now.get(parameter, sets[results.present]["overrides"].get(parameter, math.nan))
        values = [sets[name]["overrides"].get(parameter, flown) for name in results.shown]
        if all(_same(value, flown) for value in values):
            alike.append(f"{parameter} {number(flown, 6).text}")
            continue
        told = [number(one, 6, "number quiet" if _same(one, flown) else "number best") for one in values]
        rows.append([Cell(parameter, "mono"), unit_cell(_unit(parameter)), *told])
    same = f" The same in all: {', '.join(alike)}." if alike else ""
    parts = [table(("parameter", "unit", *results.shown), rows, footer=f"In grey: as the vehicle has it now.{same}")]
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


def _same(value: float, flown: float) -> bool:
    """Equal as a parameter, which is a float of 32 bits."""
    return math.isclose(value, flown, rel_tol=1e-6)


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
