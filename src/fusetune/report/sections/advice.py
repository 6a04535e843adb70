"""What would make the next logs better: the remedies of all verdicts, most frequent first."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from typing import Any

from fusetune.finding import from_documents
from fusetune.report.markup import number, table

NAMED_FLIGHTS = 3
"""Of more flights the number is told, and the first names."""


def advice_table(verdicts: Iterable[Mapping[Hashable, Any]]) -> str:
    """Remedies of warnings and refusals, each with its reason on one flight and the flights it is for.

    Parameters
    ----------
    verdicts : rows of `results/save/flights.parquet`
    """
    reasons: dict[str, str] = {}
    flights: dict[str, list[str]] = {}
    for verdict in verdicts:
        for finding in from_documents(verdict.get("advice")):
            reasons.setdefault(finding.remedy, finding.found)
            named = flights.setdefault(finding.remedy, [])
            if verdict["flight"] not in named:
                named.append(str(verdict["flight"]))
    rows = [
        (
            remedy,
            reasons[remedy] if len(names) == 1 else f"for one: {reasons[remedy]}",
            _names(names),
            number(len(names)),
        )
        for remedy, names in sorted(flights.items(), key=lambda item: (-len(item[1]), item[0]))
    ]
    return table(("what to do", "because", "flights", "how many"), rows, "For the next flights") if rows else ""


def _names(names: list[str]) -> str:
    more = len(names) - NAMED_FLIGHTS
    return ", ".join(names[:NAMED_FLIGHTS]) + (f" and {more} more" if more > 0 else "")
