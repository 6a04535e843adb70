"""Which figures of a fleet are worth drawing."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fusetune.apply.fleet.flights import OF_FLIGHT
from fusetune.report.fleet.fleet_results import Document, FleetResults

FEWEST_FLIGHTS = 3
_MOST_TRENDS = 12
_WITHIN_REACH = 4.0
"""A limit that is so many times farther than the largest value would flatten all, and is left out."""


def trend_columns(results: FleetResults) -> list[int]:
    """Columns of the table: figures that changed, then of each subject the one beyond its limit on most flights.

    None with fewer than three dated flights.
    """
    if sum(bool(one.date) for one in results.table.flights) < FEWEST_FLIGHTS:
        return []
    places = {(one.id, one.unit): place for place, one in enumerate(results.table.figures)}
    changed = [places[one["id"], one["unit"]] for one in (*results.changes, *results.drifts)]
    troubled = sorted((one for one in results.figures if _beyond(one) and is_spread(one)), key=_beyond, reverse=True)
    worst: dict[str, int] = {}
    for one in troubled:
        worst.setdefault(one["id"].partition(".")[0], places[one["id"], one["unit"]])
    return list(dict.fromkeys([*changed, *worst.values()]))[:_MOST_TRENDS]


def _beyond(one: Document) -> int:
    """On how many flights a figure lies beyond its limit."""
    return int(one["verdict"]["counts"].get("fail", 0) + one["verdict"]["counts"].get("warning", 0))


def is_spread(one: Document) -> bool:
    """Whether a histogram of a figure shows anything."""
    spread = one["distribution"]
    return (
        spread is not None
        and one["limit"] is not None
        and one["group"] != OF_FLIGHT
        and spread["n"] >= FEWEST_FLIGHTS
        and spread["minimum"] < spread["maximum"]
    )


def is_within_reach(limit: float | None, values: npt.NDArray[np.float64]) -> bool:
    """Whether a limit is near enough to what is drawn to be drawn, too."""
    known = values[np.isfinite(values)]
    return limit is not None and known.size > 0 and abs(limit) <= _WITHIN_REACH * max(float(np.abs(known).max()), 1e-12)
