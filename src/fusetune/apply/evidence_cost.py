"""How much of the evidence a set does not have itself: for it stands what it is charged."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fusetune.apply.evidence import AnalyzedFlight
from fusetune.apply.settings import DecisionSettings


def evidence_lost_percent(name: str, flights: Sequence[AnalyzedFlight], settings: DecisionSettings) -> float | None:
    """Share of the measurements and gaps that sets are judged by for which the set was charged, over all flights.

    Measurements and gaps are shares of their own, of which the mean is taken; sources count by their weights. None
    where there is nothing to judge by.

    Parameters
    ----------
    flights : those without evidence count for nobody
    """
    scored = [flight for flight in flights if flight.evidence is not None]
    parts = [
        _lost(list(_costs(name, scored, part)), weights)
        for part, weights in (("samples", settings.sources), ("gaps", _by_source(settings.withheld_sources)))
    ]
    known = [part for part in parts if part is not None]
    return sum(known) / len(known) if known else None


def _costs(name: str, flights: Sequence[AnalyzedFlight], part: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for flight in flights:
        evidence = flight.summary["sets"].get(name, {}).get("evidence", {})
        yield from evidence.get(part, {}).items()


def _by_source(weights: Mapping[str, float]) -> dict[str, float]:
    """Weights of whole sources, of which single axes may have one."""
    found: dict[str, float] = {}
    for key, weight in weights.items():
        source = key.partition(".")[0]
        found[source] = found.get(source, 0.0) + weight
    return found


def _lost(costs: Sequence[tuple[str, Mapping[str, Any]]], weights: Mapping[str, float]) -> float | None:
    mask = sum(weights.get(source, 0.0) * cost["mask"] for source, cost in costs)
    lost = sum(weights.get(source, 0.0) * (cost["lacking"] + cost["after_reset"]) for source, cost in costs)
    return 100.0 * lost / mask if mask > 0.0 else None
