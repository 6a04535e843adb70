"""Which flights flew which mission, and by how much the sets differ in each manoeuvre and on each leg."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fusetune.analyze.conformance.words import leg_name
from fusetune.analyze.flight.manoeuvre_classes import FLOWN_CLASSES
from fusetune.report.comparison import percent_change
from fusetune.report.counted import count_words
from fusetune.report.markup import Cell, details, paragraph, section, signed, table
from fusetune.report.results import Results

Document = Mapping[str, Any]

_MOST_SETS = 8


def conformance_section(results: Results, missions: Sequence[Document]) -> str:
    """Missions and who flew them, the sets by manoeuvre, and behind a click by leg.

    Parameters
    ----------
    missions : of `results/analyze/missions.json`
    """
    rows = results.decision.get("by_manoeuvre", ())
    parts = [paragraph(_flown_words(one)) for one in missions if _flew(one)]
    by_class = [one for one in rows if one["manoeuvre"]]
    if by_class:
        text = (
            "Change of the prediction error against the present set in each manoeuvre, percent, with its interval; "
            "below 0 is better. Many comparisons stand side by side: they tell where a set is better, not that it is."
        )
        kinds = [kind for kind in FLOWN_CLASSES if any(one["manoeuvre"] == kind for one in by_class)]
        parts += [paragraph(text), _table(results, by_class, "manoeuvre", kinds, kinds)]
    for mission in missions:
        legs = mission["legs"]
        of_mission = [one for one in rows if one["mission"] == mission["mission"]]
        if any(leg["flights"] for leg in legs):
            parts.append(details(f"Legs of {mission['mission']}", _legs_table(legs)))
        if of_mission:
            numbers = sorted({one["leg"] for one in of_mission})
            names = [leg_name(legs[one]) for one in numbers]
            summary = f"The sets on each leg of {mission['mission']}"
            parts.append(details(summary, _table(results, of_mission, "leg", numbers, names)))
    return section("Missions and manoeuvres", *parts, id="manoeuvres")


def not_flown(missions: Sequence[Document]) -> list[str]:
    """A line for each mission that no flight flew."""
    return [f"No flight flew the mission {one['mission']}." for one in missions if not _flew(one)]


def _flew(mission: Document) -> bool:
    return any(mission["flights"][how] for how in ("flew", "flew in part", "flew otherwise"))


def _flown_words(mission: Document) -> str:
    flights = mission["flights"]
    whole, part = flights["flew"], [*flights["flew in part"], *flights["flew otherwise"]]
    said = f"{count_words(len(whole), 'flight')} flew the mission {mission['mission']}"
    if part:
        said += f", {len(part)} in part or otherwise ({', '.join(part)})"
    others = len(flights["not this mission"])
    return f"{said}; {count_words(others, 'flight')} did not." if others else f"{said}."


def _table(results: Results, rows: Sequence[Document], key: str, columns: Sequence[Any], names: Sequence[str]) -> str:
    found = {(one["name"], one[key]): one for one in rows}
    counted = {one[key]: one["flights"] for one in rows}
    shown = [name for name in results.shown if any((name, column) in found for column in columns)][:_MOST_SETS]
    head = ("set", *(f"{name} ({counted[column]})" for name, column in zip(names, columns, strict=True)))
    lines: list[list[Cell | str]] = [
        [name, *(_cell(found.get((name, column))) for column in columns)] for name in shown
    ]
    return table(head, lines, "In brackets: flights.") if lines else ""


def _cell(one: Document | None) -> Cell:
    if one is None:
        return Cell("–", "number quiet")
    change = signed(float(percent_change(one["difference"])))
    if one["lower"] is None or one["upper"] is None:
        return Cell(change.text, "number", hint="one part of one flight shows no interval")
    lower, upper = (signed(float(percent_change(one[edge]))).text for edge in ("lower", "upper"))
    kind = "good" if one["upper"] < 0.0 else "bad" if one["lower"] > 0.0 else ""
    return Cell(f"{change.text} ({lower} to {upper})", f"number {kind}".strip())


def _legs_table(legs: Sequence[Document]) -> str:
    head = ("leg", "flights", "beside it, mean m", "most m", "height, mean m", "speed m/s", "planned m/s")
    rows: list[list[Cell | str]] = []
    for leg in legs:
        if leg["flights"]:
            plain = [f"{leg[name]:.2f}" for name in ("cross_track_mean", "cross_track_max")]
            rows.append(
                [
                    leg_name(leg),
                    Cell(str(leg["flights"]), "number"),
                    *(Cell(one, "number") for one in plain),
                    signed(leg["height_error_mean"], 2),
                    Cell(f"{leg['speed']:.1f}", "number"),
                    Cell(f"{leg['planned_speed_m_s']:.1f}", "number"),
                ]
            )
    return table(head, rows)
