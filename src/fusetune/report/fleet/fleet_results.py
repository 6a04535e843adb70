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
        """Flights by their worst finding, then by how many figures lie beyond their limits, then the refused ones."""

        def order(flight: Document) -> tuple[int, int, int, bool, str]:
            counts = flight["counts"]
            worst = rank(worst_of(flight["findings"]))
            return worst, -counts["fail"], -counts["warning"], not flight["refused"], flight["name"]

        return tuple(sorted(self.flights, key=order))

    @property
    def vehicles(self) -> int:
        """How many vehicles flew, as far as the logs could be read."""
        return len({one["vehicle"] for one in self.flights if one["is_diagnosed"]})

    def has_trouble(self, flight: Document) -> bool:
        """Whether a cause was found on a flight, a figure lies beyond its limit, or too little is known to say."""
        return (
            bool(flight["findings"] or flight["refused"]) or flight["counts"]["fail"] + flight["counts"]["warning"] > 0
        )


def read_fleet_results(fleet_file: AnyPath, health_table: AnyPath, links: Mapping[str, str]) -> FleetResults:
    """Read `results/apply/fleet.json` and `results/analyze/health.parquet`; `UserError` where one is damaged."""
    table = read_fleet_table(health_table)

    def built(document: Document) -> FleetResults:
        lists = ("flights", "causes", "figures", "changes", "drifts", "outliers")
        return FleetResults(
            **{name: tuple(document[name]) for name in lists}, product=document["product"], table=table, links=links
        )

    return read_as(fleet_file, built, "all flights together")
