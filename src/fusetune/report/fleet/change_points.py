"""Changes of a fleet by when they happened: what changes at one flight has one reason."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

from fusetune.report.counted import count_words
from fusetune.report.fleet.fleet_results import Document, FleetResults


@dataclass(frozen=True)
class ChangePoint:
    """A flight of a vehicle from which on figures are others; those with a limit first."""

    vehicle: str
    flight: str
    date: str
    along: tuple[str, ...]
    changes: tuple[Document, ...]

    @property
    def in_words(self) -> str:
        """From when on, how many figures, and what else changed."""
        along = f", with another {' and '.join(self.along)}" if self.along else ""
        figures = count_words(len(self.changes), "figure")
        return f"From {self.flight} ({self.date[:10]}{along}) on, {figures} of {self.vehicle} changed:"


def change_points(results: FleetResults) -> tuple[ChangePoint, ...]:
    """Those at which most figures change first."""
    limits = {(one["id"], one["unit"]): one["limit"] for one in results.figures}
    found: dict[tuple[str, str], list[Document]] = defaultdict(list)
    for one in results.changes:
        found[one["vehicle"], one["flight"]].append(one)
    points = []
    for (vehicle, flight), changes in found.items():
        ordered = sorted(changes, key=lambda one: (limits.get((one["id"], one["unit"])) is None, one["chance"]))
        points.append(ChangePoint(vehicle, flight, changes[0]["date"], tuple(changes[0]["along"]), tuple(ordered)))
    return tuple(sorted(points, key=lambda one: (-len(one.changes), one.date)))
