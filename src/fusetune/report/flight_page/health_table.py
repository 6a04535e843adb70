"""The health table of a flight: what lies beyond its limit first, all else by group behind a click."""

from __future__ import annotations

from collections import defaultdict

from fusetune.report.counted import count_words
from fusetune.report.figure_words import figure_words
from fusetune.report.flight_page.flight_results import Document, FlightResults
from fusetune.report.markup import Cell, details, number, paragraph, section, table
from fusetune.report.severity_words import rank

_TOLD = {"fail": "fail", "warning": "warning", "note": "note"}


def health_table_section(results: FlightResults) -> str:
    """Problems, then each group with its passes, then what does not apply."""
    problems = results.problems
    parts = []
    if problems:
        head = ("", "what", "limit", "when", "what to do")
        alike: dict[str, list[Document]] = defaultdict(list)
        for row in problems:
            alike[row["id"]].append(row)
        parts.append(table(head, [_problem_row(rows, results) for rows in alike.values()]))
    else:
        parts.append(paragraph("No figure lies beyond its limit."))
    groups: dict[str, list[Document]] = defaultdict(list)
    lacking = []
    for row in results.health:
        if row["severity"] == "does-not-apply":
            lacking.append(row)
        else:
            groups[row["group"]].append(row)
    for group, rows in groups.items():
        parts.append(_group(group, rows))
    if lacking:
        told = [(str(row["found"]),) for row in lacking]
        parts.append(
            details(f"{count_words(len(lacking), 'figure')} that this log does not tell", table(("why",), told))
        )
    return section("Health of sensors and filter", *parts)


def _problem_row(alike: list[Document], results: FlightResults) -> tuple[Cell | str, ...]:
    """A figure that lies beyond its limit, the worst of the instances told."""
    row, *others = alike
    when = results.since_start_s(row)
    words = str(row["found"]) + (" (from the replay)" if row["origin"] == "replay" else "")
    also = ", ".join(str(one["instance"]) for one in others if one["instance"] is not None)
    return (
        Cell(_TOLD[row["severity"]], f"short is-{row['severity']}"),
        words + (f"; beyond it on instance {also}, too" if also else ""),
        number(row["threshold"]),
        Cell("" if when is None else _span(*when), "short"),
        str(row["remedy"]),
    )


def _span(start: float, stop: float) -> str:
    return f"{start:.1f} s" if stop - start < 0.1 else f"{start:.1f} to {stop:.1f} s"


def _group(group: str, rows: list[Document]) -> str:
    worst = min((row["severity"] for row in rows), key=rank)
    beyond = sum(row["severity"] in ("warning", "fail") for row in rows)
    summary = f"{group[0].upper()}{group[1:]}: {count_words(len(rows), 'figure')}" + (
        f", {beyond} beyond the limit" if beyond else ""
    )
    several = len({row["instance"] for row in rows}) > 1
    head = ("figure", *(("instance",) if several else ()), "value", "unit", "limit", "told by")
    told = [
        (
            Cell(figure_words(row["id"]), f"is-{row['severity']}" if row["severity"] in _TOLD else ""),
            *((number(row["instance"]),) if several else ()),
            number(row["figure"]),
            Cell(str(row["unit"]), "quiet"),
            number(row["threshold"]),
            Cell(str(row["origin"]), "quiet"),
        )
        for row in rows
    ]
    return details(summary, table(head, told), kind={"fail": "bad", "warning": "warn"}.get(worst, "good"))
