"""What would make the next logs better: the remedies of all verdicts, most frequent first."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from typing import Any

from fusetune.finding import from_documents
from fusetune.report.counted import count_words, listed
from fusetune.report.markup import details, number, section, table

NAMED_FLIGHTS = 3
"""Of more flights the number is told, and the first names."""


def advice_section(verdicts: Iterable[Mapping[Hashable, Any]]) -> str:
    """Remedies of warnings and refusals, each with its reason on one flight and the flights it is for; empty of none.

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
            listed(names, NAMED_FLIGHTS),
            number(len(names)),
        )
        for remedy, names in sorted(flights.items(), key=lambda item: (-len(item[1]), item[0]))
    ]
    head = ("what to do", "because", "flights", "how many")
    title = f"{count_words(len(rows), 'thing')} to do, the most frequent first"
    return section("What would make the next logs better", details(title, table(head, rows, kind="cards")), id="advice")
