"""The part of the page about what to do next: steps, what these flights cannot tell, how many more it takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from fusetune.apply.missing_motion_kinds import THINNED
from fusetune.report.charts.power import power_chart
from fusetune.report.markup import Cell, anchor, bullets, details, paragraph, section, table
from fusetune.report.results import Results

ROUGH = 5
"""With fewer flights their spread is hardly known."""


def next_steps_section(results: Results) -> str:
    """Steps first, then what they rest on."""
    decision = results.decision
    parts = [steps_list(decision["next_steps"])]
    if decision["missing_motion"]:
        told = bullets([_missing(one) for one in decision["missing_motion"]])
        parts.append(details("What these flights cannot tell, and what would", told))
    power = decision["power"]
    if power:
        parts.append(
            details(
                "How many flights it takes", paragraph(_power_text(power)), power_chart(results), _power_table(power)
            )
        )
    return section("What to do next", *parts, id="next-steps")


def answer_cards(cards: Mapping[str, str]) -> str:
    """Cards beneath an answer: title → HTML; those in which nothing stands are left out."""
    told = "".join(
        f'<div class="card"><h3>{escape(title)}</h3>{inside}</div>' for title, inside in cards.items() if inside
    )
    return f'<div class="answer-cards">{told}</div>' if told else ""


def next_card(steps: Sequence[Mapping[str, Any]]) -> str:
    """The first step alone in a card."""
    return answer_cards({"Next": next_words(steps)})


def next_words(steps: Sequence[Mapping[str, Any]], place: str = "") -> str:
    """The first step, and how many more there are; empty without any.

    Parameters
    ----------
    place : id of where on the page they all stand
    """
    if not steps:
        return ""
    first, more = steps[0], len(steps) - 1
    command = f"<p><code>{escape(first['command'])}</code></p>" if first["command"] else ""
    rest = f"<p>{anchor(f'and {more} more', place)}</p>" if more and place else ""
    return paragraph(first["text"]) + command + rest


def steps_list(steps: list[dict[str, Any]]) -> str:
    """The steps as a numbered list, each with its command."""
    items = []
    for one in steps:
        command = f"<br><code>{escape(one['command'])}</code>" if one["command"] else ""
        items.append(f"<li>{escape(one['text']).replace(' %', '&nbsp;%')}{command}</li>")
    return f'<ol class="steps">{"".join(items)}</ol>'


def _missing(one: dict[str, Any]) -> str:
    return f"{one['cannot']}; {'' if one['kind'] == THINNED else 'fly '}{one['fly']}."


def _power_text(power: dict[str, Any]) -> str:
    rough = " From so few flights this is rough." if power["flights"] < ROUGH else ""
    now = f"{power['flights']} flights of {power['minutes']:.1f} scored minutes decide now"
    share = power["within_share"]
    if share is None:
        return f"{now}; they are too short to show what longer ones would bring.{rough}"
    longer = "longer flights help" if share > 0.5 else "more flights help more than longer ones"
    return (
        f"{now}. Of what varies between them, what varies within them accounts for "
        f"{100 * share:.0f} %: {longer}.{rough}"
    )


def _power_table(power: dict[str, Any]) -> str:
    rows: list[list[Cell | str]] = []
    for gain, more in power["more"].items():
        needed = [one["needed"] for one in power["curves"] if f"{one['gain_percent']:g}" == gain]
        cells = [Cell(_flights(one), "number") for one in needed]
        rows.append([f"{gain} %", *cells, Cell("none" if more == 0 else _flights(more), "number")])
    minutes = [f"{power['minutes']:.1f} min", f"{power['next_minutes']:g} min"]
    columns = [f"flights of {one}" for one in minutes[: len(rows[0]) - 2]]
    head = ("gain", *columns, f"more flights of {power['next_minutes']:.2g} min")
    return table(head, rows, f"To find a gain with {100 * power['chance_asked_for']:.0f} %")


def _flights(number: int | None) -> str:
    return "more than 30" if number is None else f"{number}"
