"""`fleet.json`: all flights together."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

import fusetune
from fusetune.apply.fleet.changes import changes
from fusetune.apply.fleet.distribution import distribution, histogram
from fusetune.apply.fleet.drivers import fleet_verdict
from fusetune.apply.fleet.flights import SEVERITIES, FleetTable, read_fleet_table
from fusetune.apply.fleet.outliers import outliers
from fusetune.apply.rounded import rounded
from fusetune.storage.documents import read_as, write_document
from fusetune.storage.files import AnyPath, atomic_path

FLEET_FILE = "fleet.json"
GROUPINGS = ("vehicle", "firmware", "mission", "month")
"""By what the figures are told apart, where a fleet has more than one."""

_SIGNIFICANT_DIGITS = 6


def write_fleet(health_table: AnyPath, diagnoses: Sequence[AnyPath], output: AnyPath) -> None:
    """Put the health and the diagnoses of all flights together.

    Parameters
    ----------
    health_table : `results/analyze/health.parquet`, with the flights that are refused, too
    diagnoses : `results/analyze/<flight>/diagnosis.json` of those that have one
    output : `results/apply/fleet.json`

    Raises
    ------
    UserError
        A file is missing or damaged, or holds something else.
    """
    read = [read_as(file, _diagnosed, "what is wrong with a flight") for file in diagnoses]
    found = {name: causes for name, causes, is_told, _ in read if is_told}
    refused = {name: reasons for name, _, _, reasons in read if reasons}
    document = fleet_document(read_fleet_table(health_table), found, refused)
    with atomic_path(output) as temporary:
        write_document(temporary, rounded(document, _SIGNIFICANT_DIGITS), lines=True, allow_nan=False)


def _diagnosed(document: dict[str, Any]) -> tuple[str, list[dict[str, Any]], bool, list[str]]:
    """Name, causes, whether it was asked for causes at all, why it is not replayed."""
    is_told = bool(document["readable"]) and "diagnosis" not in document["not_told"]
    refused = [str(one["found"]) for one in document["refused"]]
    return document["flight"], [dict(one) for one in document["diagnoses"]], is_told, refused


def fleet_document(
    table: FleetTable,
    diagnoses: Mapping[str, Sequence[Mapping[str, Any]]],
    refused: Mapping[str, Sequence[str]] | None = None,
) -> dict[str, Any]:
    """All that the fleet's flights tell together, as JSON holds it.

    Parameters
    ----------
    diagnoses : by flight, as `Diagnosis.document` tells them, what explains most first
    refused : by flight, why it cannot be replayed
    """
    refused = refused or {}
    steps, drifts = changes(table)
    return {
        "product": f"fusetune {fusetune.__version__}",
        "flights": [_flight(table, row, diagnoses, refused) for row in range(len(table.flights))],
        "causes": _causes(table, diagnoses),
        "figures": [_figure(table, column) for column in range(len(table.figures))],
        "changes": [asdict(one) for one in steps],
        "drifts": [asdict(one) for one in drifts],
        "outliers": [asdict(one) for one in outliers(table)],
    }


def _flight(
    table: FleetTable,
    row: int,
    diagnoses: Mapping[str, Sequence[Mapping[str, Any]]],
    refused: Mapping[str, Sequence[str]],
) -> dict[str, Any]:
    flight = table.flights[row]
    counts = {name: int(np.count_nonzero(table.severities[row] == place)) for place, name in enumerate(SEVERITIES)}
    told = ("id", "cause", "severity", "confidence", "since_s", "until_s")
    found = diagnoses.get(flight.name)
    return asdict(flight) | {
        "counts": {name: count for name, count in counts.items() if name != SEVERITIES[0]},
        "is_diagnosed": found is not None,
        "refused": list(refused.get(flight.name, ())),
        "findings": [{name: one[name] for name in told} for one in found or ()],
    }


def _causes(table: FleetTable, diagnoses: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[dict[str, Any]]:
    """Causes by how severe they are on the worst flight, then by the number of flights that show them."""
    shown: dict[str, dict[str, Mapping[str, Any]]] = defaultdict(dict)
    for flight in table.flights:
        for one in diagnoses.get(flight.name, ()):
            shown[one["id"]].setdefault(flight.name, one)
    causes = [
        {
            "id": cause,
            "severity": max((one["severity"] for one in flights.values()), key=SEVERITIES.index),
            "flights": list(flights),
            "vehicles": _distinct(one.vehicle for one in table.flights if one.name in flights),
            "hangs_on": _hangs_on(flights),
        }
        for cause, flights in shown.items()
    ]
    return sorted(causes, key=lambda one: (-SEVERITIES.index(one["severity"]), -len(one["flights"]), one["id"]))


def _distinct(names: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(names))


def _hangs_on(flights: Mapping[str, Mapping[str, Any]]) -> str:
    """The one flight without which the cause would be less severe or not be named; empty where there is none."""
    order = sorted(flights, key=lambda name: -SEVERITIES.index(flights[name]["severity"]))
    if len(order) > 1 and flights[order[0]]["severity"] == flights[order[1]]["severity"]:
        return ""
    return order[0]


def _figure(table: FleetTable, column: int) -> dict[str, Any]:
    figure, values = table.figures[column], table.values[:, column]
    all_flights, bins = distribution(values), histogram(values)
    names = [one.name for one in table.flights]
    return asdict(figure) | {
        "distribution": asdict(all_flights) if all_flights else None,
        "histogram": asdict(bins) if bins else None,
        "by": {grouping: _grouped(table, column, grouping) for grouping in GROUPINGS},
        "verdict": asdict(fleet_verdict(names, values, table.severities[:, column])),
    }


def _grouped(table: FleetTable, column: int, grouping: str) -> dict[str, Any]:
    """Distribution by vehicle, firmware …; empty where the fleet has but one of them."""
    rows: dict[str, list[int]] = defaultdict(list)
    for row, flight in enumerate(table.flights):
        rows[getattr(flight, grouping)].append(row)
    if len(rows) < 2:
        return {}
    spread = {name: distribution(table.values[places, column]) for name, places in rows.items()}
    return {name: asdict(one) for name, one in spread.items() if one is not None}
