"""Which flights have something wrong with them, the worst first, on the page of the decision."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fusetune.report.counted import count_words
from fusetune.report.markup import Cell, paragraph, section, table
from fusetune.report.severity_words import SEVERITY_WORDS, confidence_words, rank, worst_of
from fusetune.storage.files import AnyPath


def health_section(diagnoses: Sequence[Mapping[str, Any]], flight_pages: Mapping[str, AnyPath], page: AnyPath) -> str:
    """A line per flight that has a finding; empty where no flight was diagnosed.

    Parameters
    ----------
    diagnoses : documents `diagnosis.json`
    flight_pages : page of each flight that has one
    page : the one that this is a section of
    """
    if not diagnoses:
        return ""
    found = [one for one in diagnoses if one["diagnoses"]]
    silent = [one for one in diagnoses if one["refused"] and not one["diagnoses"]]
    found.sort(key=lambda one: (rank(worst_of(one["diagnoses"])), -len(one["diagnoses"]), one["flight"]))
    clean = len(diagnoses) - len(found) - len(silent)
    none = f"On {clean} of {count_words(len(diagnoses), 'flight')} no cause of trouble was found."
    folder = Path(page).parent
    links = {name: os.path.relpath(target, folder) for name, target in flight_pages.items()}
    untold = _untold(silent, links)
    if not found:
        return section("What is wrong with the flights", paragraph(none), untold)
    text = "No parameter cures what is broken: mend it first, then tune."
    head = ("flight", "what is wrong", "", "how sure", "what to do")
    rows = [_row(one["flight"], one["diagnoses"], links) for one in found]
    return section(
        "What is wrong with the flights", paragraph(text), table(head, rows), paragraph(none, "note"), untold
    )


def _untold(silent: Sequence[Mapping[str, Any]], links: Mapping[str, str]) -> str:
    """Logs that tell nothing, or too little to find anything wrong."""
    if not silent:
        return ""
    rows = [
        (
            Cell(one["flight"], "flight", links.get(one["flight"], "")),
            "; ".join(reason["found"] for reason in one["refused"]),
            "; ".join(dict.fromkeys(reason["remedy"] for reason in one["refused"] if reason["remedy"])),
        )
        for one in silent
    ]
    told = "tell" if len(silent) != 1 else "tells"
    text = f"{count_words(len(silent), 'log')} {told} nothing, or too little to say whether anything is wrong:"
    return paragraph(text, "note") + table(("log", "why not", "what to do"), rows)


def _row(flight: str, diagnoses: Sequence[Mapping[str, Any]], links: Mapping[str, str]) -> tuple[Cell | str, ...]:
    first = diagnoses[0]
    worst = worst_of(list(diagnoses))
    more = f" (and {len(diagnoses) - 1} more)" if len(diagnoses) > 1 else ""
    return (
        Cell(flight, "flight", links.get(flight, "")),
        Cell(str(first["cause"]).rstrip(".") + more, "said"),
        Cell(SEVERITY_WORDS[worst], f"short is-{worst}"),
        Cell(confidence_words(first["confidence"]), "short"),
        Cell(str(first["remedy"]), "advice"),
    )
