"""What the fleet's figures say together: changes, flights that stand out, what verdicts hang on, how all are spread."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

from fusetune.apply.fleet.levels import FALSE_SHARE, FEWEST_A_SIDE, FEWEST_FLIGHTS, LEVEL
from fusetune.report.charts.fleet import other_histograms_chart, trends_chart, troubled_histograms_chart
from fusetune.report.counted import count_words, listed
from fusetune.report.figure_words import figure_words
from fusetune.report.fleet.change_points import change_points
from fusetune.report.fleet.fleet_results import Document, FleetResults
from fusetune.report.markup import Cell, details, number, paragraph, section, table

_MOST_NAMED_FIGURES = 6


def changes_section(results: FleetResults) -> str:
    """Steps and drifts in tables; empty where nothing changed."""
    parts = []
    for point in change_points(results):
        head = ("figure", "before", "after", "unit", "flights before", "after", "chance")
        rows = [_change_row(one) for one in point.changes]
        parts.append(paragraph(point.in_words))
        parts.append(table(head, rows[:_MOST_NAMED_FIGURES]))
        if len(rows) > _MOST_NAMED_FIGURES:
            rest = rows[_MOST_NAMED_FIGURES:]
            parts.append(details(count_words(len(rest), "more figure"), table(head, rest)))
    if results.drifts:
        head = ("figure", "per ten flights", "interval", "unit", "flights", "vehicle", "chance")
        parts.append(table(head, [_drift_row(one) for one in results.drifts], "Drifts"))
    if parts:
        text = (
            f"Where nothing changes, a step or a drift is named in any figure in {100 * LEVEL:.0f} of 100 fleets each: "
            "the chances are corrected for the number of figures."
        )
        parts.append(paragraph(text, "note"))
    parts.append(trends_chart(results))
    return section("What changed, and when", *parts, id="changes")


def _change_row(one: Document) -> tuple[Cell | str, ...]:
    return (
        figure_words(one["id"]),
        number(one["before"]),
        number(one["after"]),
        Cell(one["unit"], "quiet"),
        number(one["flights_before"]),
        number(one["flights_after"]),
        number(one["chance"], 2),
    )


def _drift_row(one: Document) -> tuple[Cell | str, ...]:
    return (
        figure_words(one["id"]),
        number(one["per_ten_flights"]),
        Cell(f"{number(one['lower']).text} to {number(one['upper']).text}", "short"),
        Cell(one["unit"], "quiet"),
        number(one["flights"]),
        one["vehicle"],
        number(one["chance"], 2),
    )


def outliers_section(results: FleetResults) -> str:
    """Flights unlike the others of their vehicle, the figures behind a click."""
    by_flight: dict[str, list[Document]] = defaultdict(list)
    for one in results.outliers:
        by_flight[one["flight"]].append(one)
    if not by_flight:
        return ""
    text = (
        f"Compared with the other flights of the vehicle; at most {100 * FALSE_SHARE:.0f} % of what is named is "
        "chance. To be unlike the others is not to be wrong: the limits say that."
    )
    head = ("figure", "this flight", "usually", "unit", "robust z", "judged")
    parts = [paragraph(text, "note")]
    for flight, found in sorted(by_flight.items(), key=lambda item: -len(item[1])):
        rows = [
            (
                figure_words(one["id"]),
                number(one["value"]),
                number(one["usual"]),
                Cell(one["unit"], "quiet"),
                number(one["z"], 2),
                Cell(one["severity"], f"short is-{one['severity']}"),
            )
            for one in found
        ]
        words = listed([figure_words(one["id"]) for one in found], 2, "; ")
        parts.append(details(f"{flight}: {words}", table(head, rows)))
    return section("Flights that stand out", *parts, id="outliers")


def verdicts_section(results: FleetResults) -> str:
    """Flights that alone make the fleet's verdict worse, and behind a click each figure beyond its limit."""
    beyond = [one for one in results.figures if one["verdict"]["worst"] in ("warning", "fail")]
    if not beyond:
        return ""
    text = (
        "Each flight was left out in turn. Without those named here, figures of the fleet would be judged otherwise: "
        "look at them first."
    )
    driven: dict[str, list[str]] = defaultdict(list)
    for one in beyond:
        for flight in _judged_otherwise(one["verdict"]):
            driven[flight].append(figure_words(one["id"]))
    order = sorted(driven.items(), key=lambda item: (-len(item[1]), item[0]))
    rows = [
        (
            Cell(flight, "short", results.links.get(flight, "")),
            number(len(words)),
            listed(words, _MOST_NAMED_FIGURES, "; "),
        )
        for flight, words in order
    ]
    parts = [paragraph(text, "note"), table(("flight", "figures", "which"), rows)] if rows else []
    head = ("figure", "worst", "typical", "flights", "fail", "warning", "hangs on")
    summary = f"{count_words(len(beyond), 'figure')} beyond the limit on some flight"
    return section(
        "What verdicts hang on", *parts, details(summary, table(head, [_verdict_row(one) for one in beyond]))
    )


def _verdict_row(one: Document) -> tuple[Cell | str, ...]:
    verdict = one["verdict"]
    judged = _judged_otherwise(verdict)
    moved = [driver["flight"] for driver in verdict["drivers"] if driver["flight"] not in judged]
    words = [listed(judged)] if judged else []
    words += [f"its mean on {listed(moved)}"] if moved else []
    return (
        figure_words(one["id"]),
        Cell(verdict["worst"], f"short is-{verdict['worst']}"),
        Cell(verdict["typical"], f"short is-{verdict['typical']}"),
        number(verdict["flights"]),
        number(verdict["counts"].get("fail", 0)),
        number(verdict["counts"].get("warning", 0)),
        "; ".join(words),
    )


def _judged_otherwise(verdict: Document) -> list[str]:
    """Flights without which the worst or the typical severity is another."""
    told = (verdict["worst"], verdict["typical"])
    return [driver["flight"] for driver in verdict["drivers"] if (driver["worst"], driver["typical"]) != told]


def untold(results: FleetResults) -> list[str]:
    """What there is nothing to say about, each in a line."""
    lines = []
    if not results.changes and not results.drifts:
        few = f"a change takes {FEWEST_A_SIDE} flights before and after to show"
        lines.append(f"No figure of a vehicle changed over time beyond chance ({few}).")
    if not results.outliers:
        few = f"only vehicles with {FEWEST_FLIGHTS} flights and more are asked"
        lines.append(f"No flight differs from the others of its vehicle ({few}).")
    if not any(one["verdict"]["worst"] in ("warning", "fail") for one in results.figures):
        lines.append("On no flight does a figure lie beyond its limit.")
    return lines


def figures_section(results: FleetResults) -> str:
    """All figures in quantiles, by group, and by vehicle where there are several; how to read the table oneself."""
    groups: dict[str, list[Document]] = defaultdict(list)
    for one in results.figures:
        if one["distribution"]:
            groups[one["group"]].append(one)
    head = ("figure", "unit", "flights", "5 %", "median", "95 %", "largest", "limit")
    parts = []
    for group, found in groups.items():
        rows: list[tuple[Cell | str, ...]] = []
        for one in found:
            rows.append(_spread_row(figure_words(one["id"]), one["unit"], one["distribution"], one["limit"]))
            by_vehicle = one["by"]["vehicle"].items()
            rows += [_spread_row(f"   {name}", "", spread, None, "quiet") for name, spread in by_vehicle]
        parts.append(details(f"{group[0].upper()}{group[1:]}: {count_words(len(found), 'figure')}", table(head, rows)))
    text = "All of it is one table, a line per figure and flight: results/analyze/health.parquet, for pandas or DuckDB."
    if not parts:
        return ""
    spread = [
        details("How those beyond their limits are spread", troubled_histograms_chart(results)),
        details("How the others are spread", other_histograms_chart(results)),
    ]
    return section("All figures of health", *spread, *parts, paragraph(text, "note"), id="figures")


def _spread_row(
    words: str, unit: str, spread: Mapping[str, float], limit: float | None, kind: str = ""
) -> tuple[Cell | str, ...]:
    numbers = [number(spread[name]) for name in ("n", "p05", "median", "p95", "maximum")]
    return (Cell(words, kind), Cell(unit, "quiet"), *numbers, number(limit))
