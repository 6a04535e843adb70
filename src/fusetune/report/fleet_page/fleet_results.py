"""What the page of a fleet reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fusetune.apply.fleet.flights import FleetTable, read_fleet_table
from fusetune.report.severity_words import rank, worst_of
from fusetune.storage.documents import read_as
from fusetune.storage.files import AnyPath

Document = Mapping[str, Any]


@dataclass(frozen=True)
class FleetResults:
    """`fleet.json`, and the table that it is made from.

    Attributes
    ----------
    links : page of each flight that has one, relative to the page of the fleet
    """

    flights: tuple[Document, ...]
    causes: tuple[Document, ...]
    figures: tuple[Document, ...]
    changes: tuple[Document, ...]
    drifts: tuple[Document, ...]
    outliers: tuple[Document, ...]
    product: str
    table: FleetTable
    links: Mapping[str, str]

    @property
    def worst_first(self) -> tuple[Document, ...]:
        """Flights by their worst finding, then by how many figures lie beyond their limits."""

        def order(flight: Document) -> tuple[int, int, int, str]:
            counts = flight["counts"]
            return rank(worst_of(flight["findings"])), -counts["fail"], -counts["warning"], flight["name"]

        return tuple(sorted(self.flights, key=order))

    def has_trouble(self, flight: Document) -> bool:
        """Whether a cause was found on a flight, or a figure lies beyond its limit."""
        return bool(flight["findings"]) or flight["counts"]["fail"] + flight["counts"]["warning"] > 0


def read_fleet_results(fleet_file: AnyPath, health_table: AnyPath, links: Mapping[str, str]) -> FleetResults:
    """Read `results/apply/fleet.json` and `results/analyze/health.parquet`; `UserError` where one is damaged."""
    table = read_fleet_table(health_table)

    def built(document: Document) -> FleetResults:
        lists = ("flights", "causes", "figures", "changes", "drifts", "outliers")
        return FleetResults(
            **{name: tuple(document[name]) for name in lists}, product=document["product"], table=table, links=links
        )

    return read_as(fleet_file, built, "all flights together")
