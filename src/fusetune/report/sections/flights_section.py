"""Every log in order of time: its part in the decision, how far its replay can be trusted, what is wrong with it."""

from __future__ import annotations

import os
from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from fusetune.finding import from_documents
from fusetune.report.comparison import flight_changes
from fusetune.report.counted import count_words
from fusetune.report.flight_names import in_time_order
from fusetune.report.markup import (
    Cell,
    CellLike,
    Html,
    details,
    grouped_table,
    number,
    paragraph,
    section,
    signed,
    table,
)
from fusetune.report.results import Results
from fusetune.report.sections.trust_section import GRADE_KINDS
from fusetune.report.severity_words import worst_of
from fusetune.storage.files import AnyPath

DECIDES = "In the decision"
OTHER_VEHICLES = "Other vehicles: replayed and graded, not in the decision"
NOT_COUNTED = "Replayed, not in the decision"
NOT_REPLAYED = "Cannot be replayed"

Document = Mapping[str, Any]


@dataclass(frozen=True)
class Logs:
    """All logs, and what was found on each.

    Attributes
    ----------
    verdicts : rows of `results/save/flights.parquet` by flight, the oldest first
    diagnoses : documents `diagnosis.json` by flight
    grades : trust grade by flight, of those that were compared
    pages : page of each flight, relative to the report
    """

    verdicts: Mapping[str, Mapping[Hashable, Any]]
    diagnoses: Mapping[str, Document]
    grades: Mapping[str, str]
    pages: Mapping[str, str]

    @staticmethod
    def of(
        verdicts: Sequence[Mapping[Hashable, Any]],
        diagnoses: Sequence[Document],
        trust: Sequence[Document],
        pages: Sequence[AnyPath],
        report: AnyPath,
    ) -> Logs:
        """From documents and files in any order; links are those of `report`."""
        by_name = {str(one["flight"]): one for one in verdicts}
        folder = Path(report).parent
        return Logs(
            verdicts={name: by_name[name] for name in in_time_order(verdicts)},
            diagnoses={one["flight"]: one for one in diagnoses},
            grades={one["flight"]: str(one["trust"]["grade"]) for one in trust},
            pages={Path(page).stem: os.path.relpath(page, folder) for page in pages},
        )

    def findings(self, flight: str) -> Sequence[Document]:
        """What is wrong on a flight."""
        return tuple(self.diagnoses[flight]["diagnoses"]) if flight in self.diagnoses else ()


def flights_section(results: Results, logs: Logs, shown: Collection[str] = ()) -> str:
    """A table of all logs in groups, each in order of time.

    Parameters
    ----------
    shown : flights that the page's own viewer can show
    """
    compared = _compared_set(results)
    changes = flight_changes(results)
    by_flight = changes[compared].to_dict() if compared in changes else {}
    groups: dict[str, list[list[CellLike]]] = {DECIDES: [], NOT_COUNTED: [], OTHER_VEHICLES: [], NOT_REPLAYED: []}
    for name in logs.verdicts:
        row = _row(name, results, logs, by_flight)
        groups[_group(name, results)].append([*row, _look(name, shown)] if shown else row)
    head = ["flight", "recorded", "in the air s", "trust grade", "what is wrong", "remark"]
    if by_flight:
        head.append("change %")
    if shown:
        head.append("")
    text = f"{count_words(len(logs.verdicts), 'log')}, each group in order of time; a name leads to the flight's page."
    note = (
        f"Change: of the prediction error on the flight with “{compared}” against what flies now; below 0 is better."
        if by_flight
        else ""
    )
    named = {f"{name}: {len(rows)}": rows for name, rows in groups.items() if rows}
    told = grouped_table(*_without_empty_columns(head, named), kind="cards flights", footer=note)
    whole: list[list[CellLike]] = [
        [Cell(name), _words(one, "vehicle"), _words(one, "firmware"), str(one.get("replayed_as") or "–")]
        for name, one in logs.verdicts.items()
    ]
    return section(
        "The flights",
        paragraph(text, "note"),
        told,
        details(
            "Whole names, vehicles, firmware", table(("log", "vehicle", "firmware", "replayed as"), whole, kind="whole")
        ),
        id="flights",
    )


def _without_empty_columns(
    head: Sequence[str], groups: Mapping[str, Sequence[Sequence[CellLike]]]
) -> tuple[list[str], dict[str, list[list[CellLike]]]]:
    """A table without the columns in which nothing stands."""
    rows = [row for group in groups.values() for row in group]
    kept = [place for place in range(len(head)) if any(_says(row[place]) for row in rows)]
    return [head[place] for place in kept], {
        name: [[row[place] for place in kept] for row in group] for name, group in groups.items()
    }


def _says(cell: CellLike) -> bool:
    text = cell if isinstance(cell, str) else cell.html if isinstance(cell, Html) else cell.text
    return text not in ("", "–")


def _words(verdict: Mapping[Hashable, Any], name: str) -> str:
    return str(verdict.get(name) or "unknown")


def _compared_set(results: Results) -> str:
    """The set whose change is told on each flight: the chosen one, or the nearest to what flies now."""
    decision = results.decision
    chosen = decision["chosen"] if decision["status"] == "change" else decision["best_candidate"]
    return str(chosen or "")


def _group(name: str, results: Results) -> str:
    if name in results.flights:
        return DECIDES
    vehicle = results.decision["vehicle"]
    if vehicle is not None and name in vehicle["left_out"]:
        return OTHER_VEHICLES
    return NOT_COUNTED if name in results.scoring else NOT_REPLAYED


def _row(name: str, results: Results, logs: Logs, changes: Mapping[Hashable, float]) -> list[CellLike]:
    verdict = logs.verdicts[name]
    recorded = str(verdict.get("recorded") or "").replace("T", " ")[:16]
    grade = logs.grades.get(name, "")
    row: list[CellLike] = [
        Cell(name, "flight", logs.pages.get(name, "")),
        Cell(recorded or "–", "short" if recorded else "quiet"),
        number(verdict.get("airborne_s"), 3),
        Cell(grade or "–", f"mark {GRADE_KINDS.get(grade, 'quiet')}"),
        _wrong(logs.findings(name)),
        Cell(_why_not(name, results, verdict), "said"),
    ]
    if changes:
        change = changes.get(name)
        kind = "number" if change is None or not change else f"number {'good' if change < 0.0 else 'bad'}"
        row.append(Cell("", "number") if change is None else signed(change, kind=kind))
    return row


def _look(name: str, shown: Collection[str]) -> Html:
    if name not in shown:
        return Html("")
    state = escape(urlencode({"flight": name}))
    return Html(f'<a href="#viewer" data-state="{state}">look<span class="hidden"> at {escape(name)}</span></a>')


def _wrong(findings: Sequence[Document]) -> Cell:
    if not findings:
        return Cell("", "quiet")
    more = f" (and {len(findings) - 1} more)" if len(findings) > 1 else ""
    return Cell(str(findings[0]["cause"]).rstrip(".") + more, f"said is-{worst_of(list(findings))}")


def _why_not(name: str, results: Results, verdict: Mapping[Hashable, Any]) -> str:
    if name in results.flights:
        return ""
    vehicle = results.decision["vehicle"]
    if vehicle is not None and name in vehicle["left_out"]:
        return str(vehicle["left_out"][name])
    return results.reason(name) if name in results.scoring else str(verdict.get("reason") or "")


def single_flights_section(results: Results) -> str:
    """What was cut out of each flight, and what befell the sets on it, closed until asked for."""
    rows = [_cut_row(name, results) for name in results.scoring]
    head = ("flight", "scored s", "cut s", "because of")
    cuts = details("What is scored of each flight", table(head, rows))
    troubles = [row for name, summary in results.scoring.items() for row in _set_troubles(name, summary)]
    columns = ("flight", "set", "resets in flight", "lost sources", "faults", "note")
    text = f"What befell the sets: {count_words(len(troubles), 'case')}"
    return section("What is scored", cuts, details(text, table(columns, troubles)))


def _cut_row(name: str, results: Results) -> tuple[CellLike, ...]:
    summary = results.scoring[name]
    cuts = from_documents(summary["cuts"])
    seconds = sum(float(cut.figure or 0.0) for cut in cuts)
    why = "; ".join(dict.fromkeys(cut.found for cut in cuts)) or results.reason(name)
    return (name, number(summary["scored_s"]), number(seconds) if cuts else Cell("–", "number quiet"), why)


def _set_troubles(flight: str, summary: Document) -> list[tuple[CellLike, ...]]:
    rows: list[tuple[CellLike, ...]] = []
    for name, one in summary["sets"].items():
        resets = sum(one["resets"].values())
        lost = ", ".join(f"{source} ×{count}" for source, count in one["timeouts"].items())
        faults = ", ".join(fault.removeprefix("fs_") for fault in one["faults"])
        if one["reason"] or one["evidence"]["left_out"] or resets or lost or faults:
            far = f"{resets}, {one['significant_resets']} of them far" if resets else "–"
            note = one["reason"] or "; ".join(one["evidence"]["left_out"].values())
            rows.append((flight, name, far, lost, faults, note))
    return rows
