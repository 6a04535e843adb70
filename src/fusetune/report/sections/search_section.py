"""The part of the page about a search: what to set, what it is worth, and what shows that."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from fusetune.apply.search.answer import headline, unit_of, why_kept
from fusetune.apply.search.words import worth_sentences
from fusetune.apply.sensitivity.result import FLAT, MATTERS, NOT_TOLD, UNSURE
from fusetune.report.charts.search import found_chart, found_pareto_chart, kept_aside_chart, shrinkage_chart
from fusetune.report.charts.sensitivity import sensitivity_chart
from fusetune.report.counted import count_words
from fusetune.report.markup import (
    Cell,
    bullets,
    details,
    drawn,
    number,
    paragraph,
    prose,
    section,
    severity_mark,
    signed,
    table,
    unit_cell,
)
from fusetune.report.search_results import SearchResults
from fusetune.report.sections.loading import NOTHING_TO_LOAD, file_to_load, how_to_load
from fusetune.report.sections.next_steps_section import next_card, steps_list

_MATTERS_WORDS = {MATTERS: "yes", FLAT: "hardly", UNSURE: "not sure", NOT_TOLD: "not told"}
_DIGITS = 4
_KEPT_ASIDE = (
    "One bar for each flight: what was found without this flight, flown on it, against what flies now. Line and shade: "
    "the change to expect on as many flights again, and its 95 % interval."
)


def search_answer(results: SearchResults) -> str:
    """What to set and what it is worth, in a box."""
    search, decision = results.search, results.decision
    mark = severity_mark("warning", "exploratory") if search["exploratory"] else ""
    vehicle = decision["vehicle"]["in_words"] if decision["vehicle"] else "unknown vehicle"
    told = prose(f"{vehicle} · {count_words(len(search['flights']), 'flight')}")
    parts = [f'<p class="eyebrow">{told} {mark}</p><h2>{prose(headline(search, decision))}</h2>']
    parts += [paragraph(one, "lead" if place == 0 else "") for place, one in enumerate(worth_sentences(search))]
    if results.is_change:
        parts.append(bullets(decision["cautions"]))
    parts += [paragraph(one) for one in why_kept(search, decision)]
    parts.append(_load(results))
    words = f'<div class="answer-words">{"".join(parts)}</div>'
    picture = kept_aside_chart(results)
    beside = f'<div class="answer-figure">{drawn(picture, _KEPT_ASIDE)}</div>' if picture else ""
    kind = f"answer is-{escape(decision['status'])}{' has-figure' if picture else ''}"
    return f'<section class="{kind}" id="answer">{words}{beside}{next_card(decision["next_steps"])}</section>'


def _load(results: SearchResults) -> str:
    if not (results.is_change and results.decision["on_vehicle"]["parameters"]):
        return paragraph(NOTHING_TO_LOAD, "note")
    return file_to_load() + how_to_load()


def search_found(results: SearchResults) -> str:
    """The parameters that were searched, and where they went."""
    caption = (
        "Where each parameter is and where the search on all flights took it, inside the bounds that it may move in. "
        "Small: what the same search found with a part of the flights kept aside. Where they lie together the flights "
        "determine the value; where they scatter, it could be another as well."
    )
    return section(
        "What the search found",
        _parameters(results),
        drawn(found_chart(results), caption),
        paragraph(
            "Prediction errors: how far off the estimator was when it predicted a measurement before it saw it, and "
            "how far velocity and position had drifted after seconds without GNSS. Kept aside: flights that the search "
            "which found the values had not seen, as it will not have seen the next ones.",
            "note",
        ),
    )


def _parameters(results: SearchResults) -> str:
    verdicts = {}
    if results.sensitivity.found is not None:
        verdicts = {one.parameter: one.verdict for one in results.sensitivity.found.parameters}
    parameters: Mapping[str, Mapping[str, Any]] = results.search["parameters"]
    ordered = sorted(
        parameters.items(), key=lambda item: (not item[1]["is_changed"], -(item[1]["alone_percent"] or 0.0))
    )
    rows: list[tuple[Cell | str, ...]] = []
    for name, one in ordered:
        rows.append(
            (
                Cell(name, "mono"),
                number(one["present"], _DIGITS),
                number(one["found"], _DIGITS, "number best") if one["is_changed"] else number(None),
                unit_cell(unit_of(name)),
                number(one["alone_percent"], 2),
                _MATTERS_WORDS.get(verdicts.get(name, NOT_TOLD), ""),
                Cell(*_remark(one)),
            )
        )
    rows += [
        _goes_along(name, value) for name, value in results.search["parameters_found"].items() if name not in parameters
    ]
    return table(
        ("parameter", "now", "found", "unit", "without it errors larger by %", "matters here", ""),
        rows,
        "Found: by the search on all flights. Without it: with this one alone put back to what flies now",
    )


def _remark(one: Mapping[str, Any]) -> tuple[str, str]:
    """What there is to say of a parameter, and its class."""
    if one["at_bound"]:
        return f"not determined: {one['at_bound']} value that was tried, the best may lie beyond", "bad"
    if one["is_changed"]:
        return "", ""
    if one["before_putting_back"] != one["present"]:
        return f"put back: {one['before_putting_back']:.3g} gained next to nothing", "quiet"
    return "nothing better found", "quiet"


def _goes_along(name: str, value: float) -> tuple[Cell | str, ...]:
    nothing = number(None)
    along = Cell("goes along with the longer delay", "quiet")
    return (
        Cell(name, "mono"),
        nothing,
        number(value, _DIGITS, "number best"),
        unit_cell(unit_of(name)),
        nothing,
        "",
        along,
    )


def search_evidence(results: SearchResults) -> str:
    """What shows that: gains on flights kept aside, luck, what matters, the two aims."""
    if results.parts:
        worth = [
            drawn(
                shrinkage_chart(results),
                "What a search promises on the flights it saw, and what is left of it on flights that it did not see. "
                "A search always fits some chance of its own flights; the distance is that luck. A single part may do "
                "better than promised when its flights happen to be easier.",
            ),
        ]
    else:
        worth = [
            paragraph("A single flight leaves none to keep aside: what is luck in the gain cannot be seen. Add logs.")
        ]
    told = results.sensitivity.sentences
    matters = [paragraph(told[0]), bullets(told[1:]), sensitivity_chart(results.sensitivity.found)]
    aims = drawn(
        found_pareto_chart(results),
        "Every set that the search on all flights tried. On the line (the Pareto front) nothing gains in one without "
        "losing in the other. The search takes no set that pays for one with the other.",
    )
    return "\n".join(
        (
            section("What it is worth on flights that the search did not see", *worth),
            section("What matters", *matters),
            section("Two aims: accuracy with all sensors, drift without GNSS", aims),
            section("How it was searched", *_how(results)),
        )
    )


def _change(gain: float | None) -> Cell:
    """A gain as the change of the errors that it is."""
    return signed(None if gain is None else -gain if gain else 0.0)


def _how(results: SearchResults) -> list[str]:
    search = results.search
    tried = sum(one["search"] == "all flights" for one in search["candidates"])
    parts = [
        paragraph(
            f"{tried} sets on {len(search['flights'])} flights"
            + (
                f", and the same search again without each of {len(results.parts)} parts of them, to judge what it "
                "finds on flights it did not see."
                if results.parts
                else "."
            )
            + " Delays and lever arms are searched first, then everything together, then each change that brings less "
            f"than {search['settings']['putting_back_percent']:g} % is put back. Every set is replayed on the flights' "
            "recorded sensor data; trials.json and search.json hold all of them."
        )
    ]
    if search["flights_left_out"]:
        parts.append(bullets([f"{name}: left out, {why}" for name, why in search["flights_left_out"].items()]))
    rows = [
        (
            one["search"],
            ", ".join(one["kept_aside"]) or "none",
            _change(one["gain_in_search_percent"]),
            _change(one["gain_kept_aside_percent"]),
            ", ".join(f"{name} {one['values'][name]:.3g}" for name in one["changed"]) or "nothing",
        )
        for one in search["searches"]
    ]
    head = ("search", "kept aside", "change on what it saw %", "change kept aside %", "found")
    parts.append(details("What each search found", table(head, rows)))
    return parts


def search_next_steps(results: SearchResults) -> str:
    """What to do next, as the decision says."""
    steps = results.decision["next_steps"]
    return section("What to do next", steps_list(steps)) if steps else ""
