"""The health table of a flight: what lies beyond its limit first, all else by group behind a click."""

from __future__ import annotations

from collections import defaultdict

from fusetune.report.charts.timeline import timeline_chart
from fusetune.report.counted import count_words
from fusetune.report.figure_words import figure_words
from fusetune.report.flight_results import Document, FlightResults
from fusetune.report.markup import Cell, CellLike, Html, details, number, paragraph, section, severity_mark, table
from fusetune.report.severity_words import rank

_TOLD = {"fail": "fail", "warning": "warning", "note": "note"}
_WORDS = (
    "fail: far beyond the limit, warning: beyond it. A test ratio compares how far a measurement lies from what the "
    "filter expected with how far it may: above 1 the filter rejects the measurement."
)


def health_table_section(results: FlightResults) -> str:
    """Problems, then each group with its passes, then what does not apply; empty of a log that could not be read."""
    if not results.is_readable:
        return ""
    problems = results.problems
    parts = []
    if problems:
        parts.append(paragraph(_WORDS, "note"))
        head = ("", "what", "limit", "when", "what to do")
        alike: dict[str, list[Document]] = defaultdict(list)
        for row in problems:
            alike[row["id"]].append(row)
        parts.append(table(head, [_problem_row(rows, results) for rows in alike.values()], kind="cards findings"))
    else:
        parts.append(paragraph("No figure lies beyond its limit."))
    parts.append(details("When they lie beyond their limits", timeline_chart(results) if problems else ""))
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
    return section("Health of sensors and filter", *parts, id="health")


def _problem_row(alike: list[Document], results: FlightResults) -> tuple[CellLike, ...]:
    """A figure that lies beyond its limit, the worst of the instances told."""
    row, *others = alike
    when = results.since_start_s(row)
    words = str(row["found"]) + (" (from the replay)" if row["origin"] == "replay" else "")
    also = ", ".join(str(one["instance"]) for one in others if one["instance"] is not None)
    return (
        Html(severity_mark(row["severity"], _TOLD[row["severity"]]), "short"),
        words + (f"; beyond it on instance {also}, too" if also else ""),
        _limit(row),
        Cell("" if when is None else results.times.in_words(*when)),
        str(row["remedy"]),
    )


def _unit(row: Document) -> str:
    """Shares are told in percent, as the words about them do."""
    return "%" if row["id"].endswith("_share") else str(row["unit"])


def _in_unit(row: Document, value: float | None) -> float | None:
    return 100.0 * value if value is not None and row["id"].endswith("_share") else value


def _limit(row: Document) -> Cell:
    told = number(_in_unit(row, row["threshold"]))
    return told if row["threshold"] is None else Cell(f"{told.text} {_unit(row)}".rstrip(), f"{told.kind} short")


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
            number(_in_unit(row, row["figure"])),
            Cell(_unit(row), "quiet"),
            number(_in_unit(row, row["threshold"])),
            Cell(str(row["origin"]), "quiet"),
        )
        for row in rows
    ]
    return details(summary, table(head, told), kind={"fail": "bad", "warning": "warn"}.get(worst, "good"))
