"""The first screen: for which vehicle, what to load, how sure, what it brings, what to mend first, what to do next."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator, Mapping
from html import escape
from typing import Any

from fusetune.apply.ranking import SAME
from fusetune.report.comparison import percent_change
from fusetune.report.counted import count_words
from fusetune.report.markup import (
    Cell,
    CellLike,
    Html,
    anchor,
    number,
    paragraph,
    prose,
    severity_mark,
    signed,
    table,
    unit_cell,
)
from fusetune.report.results import Results
from fusetune.report.sections.loading import NOTHING_TO_LOAD, file_to_load, how_to_load
from fusetune.report.sections.next_steps_section import answer_cards, next_words
from fusetune.report.sections.ranking_tables import NOT_KNOWN, confidence_of, interval_text
from fusetune.report.sections.truth_section import truth_verdict
from fusetune.report.severity_words import SEVERITY_WORDS

APPLY_FOLDER = "results/apply/"

_MOST_PROBLEMS = 3
_DIAGNOSED = "diagnosis."


def first_screen(results: Results, picture: str = "") -> str:
    """The answer.

    Parameters
    ----------
    picture : the one figure beside it, HTML; the answer has the whole width without one
    """
    status = results.decision["status"]
    beside = f'<div class="answer-figure">{picture}</div>' if picture else ""
    words = f'<div class="answer-words">{_title(results)}{_gain(results)}{_load(results)}</div>'
    cards = _cards(results)
    return (
        f'<section class="answer is-{escape(status)}{" has-figure" if picture else ""}" id="answer">'
        f"{words}{beside}{cards}</section>"
    )


def _title(results: Results) -> str:
    decision = results.decision
    vehicle = decision["vehicle"]
    who = vehicle["in_words"] if vehicle else "unknown vehicle"
    flights = count_words(decision["flights_scored"], "flight")
    minutes = sum(row.get("scored_s") or 0.0 for row in decision["flights"] if row["scored"]) / 60.0
    told = f"{who} · {flights}" + (f", {minutes:.1f} minutes scored" if minutes else "")
    marks = [severity_mark("warning", "exploratory")] if decision["exploratory"] else []
    if vehicle and vehicle["kind"] != "real":
        marks.append(severity_mark("note", "simulated"))
    return f'<p class="eyebrow">{prose(told)} {"".join(marks)}</p><h2>{prose(heading(results))}</h2>'


def heading(results: Results) -> str:
    """The decision in a few words."""
    decision = results.decision
    if decision["status"] == "change":
        return f"Change {count_words(len(decision['changes']), 'parameter')}"
    return "Keep what flies now"


def _gain(results: Results) -> str:
    """What it brings: of a change by how much errors shrink, of none what the nearest other set would do."""
    decision = results.decision
    rows = {one["name"]: one for one in results.ranking.to_dict("records")}
    if decision["status"] == "change":
        one = rows[decision["chosen"]]
        return _figure(results, one)
    other = _nearest(results, rows)
    if other is None:
        why = "No flight has a say in it." if not results.flights else "No other set was compared with it."
        return _lead(why)
    return _lead(f"No other set proved better. The nearest, “{other['name']}”: {_change_words(results, other)}.")


def _lead(text: str) -> str:
    return f'<p class="lead">{prose(text)}</p>'


def _nearest(results: Results, rows: Mapping[Hashable, Mapping[Hashable, Any]]) -> Mapping[Hashable, Any] | None:
    """The set that the decision names beside the present one, or the first of the ranking that differs from it."""
    best = results.decision["best_candidate"]
    if best in rows and best != results.present:
        return rows[best]
    others = (one for name, one in rows.items() if name != results.present and one["status"] != SAME)
    return next((one for one in others if _is_known(one["difference"])), None)


def _change_words(results: Results, one: Mapping[Hashable, Any]) -> str:
    change = float(percent_change(one["difference"]))
    size = f"{abs(change):.1f} % {'smaller' if change < 0.0 else 'larger'}" if change else "the same as now"
    return f"prediction errors {size} {_span(results, one)}"


def _span(results: Results, one: Mapping[Hashable, Any]) -> str:
    ends = interval_text(one["lower"], one["upper"])
    if ends == NOT_KNOWN:
        return "(how far chance could do that is not known)"
    return f"({confidence_of(results)} interval {ends} %)"


def _on_flights(one: Mapping[Hashable, Any]) -> str:
    better, flights = int(one["flights_better"]), int(one["flights"])
    return f", smaller on {better} of {count_words(flights, 'flight')}"


def _figure(results: Results, one: Mapping[Hashable, Any]) -> str:
    """By how much errors change, large, and how far that is sure."""
    change = signed(float(percent_change(one["difference"]))).text
    words = f"prediction errors {_span(results, one)}{_on_flights(one)}"
    return f'<p class="gain"><span class="gain-figure">{change}&nbsp;%</span> <span>{prose(words)}</span></p>'


def _load(results: Results) -> str:
    """What to load: the file, and what it changes."""
    on_vehicle = results.decision["on_vehicle"]
    if not results.decision["changes"]:
        return paragraph(NOTHING_TO_LOAD, "note")
    changes = table(("parameter", "now", "", "new", "unit", ""), _change_rows(results.decision), kind="changes")
    if not on_vehicle["parameters"]:
        refused = " ".join(f"{one['name']}: {one['reason']}. {one['remedy']}." for one in on_vehicle["refused"])
        nothing = "There is nothing to load, as this vehicle cannot be given all of it."
        return f"{changes}<p>{prose(f'{nothing} {refused}')}</p>"
    return f"{file_to_load(APPLY_FOLDER)}{changes}{how_to_load(APPLY_FOLDER)}"


def _change_rows(decision: Mapping[str, Any]) -> list[tuple[CellLike, ...]]:
    in_file = {stood: one["name"] for one in decision["on_vehicle"]["parameters"] for stood in one["stands_for"]}
    return [_change_row(change, in_file.get(change["name"], change["name"])) for change in decision["changes"]]


def _change_row(change: Mapping[str, Any], in_file: str) -> tuple[CellLike, ...]:
    remarks = ["after a reboot"] if change["reboot_required"] else []
    if in_file != change["name"]:
        remarks.append(f"in the file {in_file}")
    if change["alone"]:
        remarks.append(str(change["alone"]))
    return (
        Cell(change["name"], "mono"),
        number(change["previous"], 6, "number old"),
        Html("→", "arrow"),
        number(change["value"], 6, "number new"),
        unit_cell(change["unit"]),
        Cell("; ".join(remarks), "quiet"),
    )


def _cards(results: Results) -> str:
    steps = results.decision["next_steps"]
    return answer_cards(
        {"How sure": _how_sure(results), "Mend first": _mend_first(results), "Next": next_words(steps, "next-steps")}
    )


def _how_sure(results: Results) -> str:
    said = list(_sure_sentences(results))
    return "".join(f"<p>{prose(one)}</p>" for one in said)


def _sure_sentences(results: Results) -> Iterator[str]:
    decision = results.decision
    count, enough = decision["flights_scored"], decision["rule"]["minimum_flights"]
    if decision["exploratory"] and count:
        yield f"Not sure: {count_words(count, 'flight')} cannot speak for the next; it takes at least {enough}."
    if decision["status"] == "change":
        yield f"{'' if decision['exploratory'] else 'Sure: '}{_why_sure(results)}"
        verdict = truth_verdict(results)
        if verdict:
            yield f"The known truth {verdict}."
    elif not decision["exploratory"]:
        yield "No set is shown to be better than what flies now on all that was flown."
    yield from decision["cautions"]


def _why_sure(results: Results) -> str:
    validated = results.decision["leave_one_out"]
    beyond = "the whole interval lies on the better side"
    if validated is None:
        return f"{beyond}."
    stays, count = validated["stays"], len(validated["chosen"])
    same = "whichever flight is left out" if stays == count else f"without any one of {stays} of the {count} flights"
    change = signed(float(percent_change(validated["difference"]))).text
    return f"{beyond}, and the same set is best {same}; on the one left out errors change by {change} %."


def _mend_first(results: Results) -> str:
    """The worst of what was found wrong."""
    changed = {one["name"] for one in results.decision["changes"]}
    findings = [one for one in results.decision["findings"] if _is_to_mend(one, changed)]
    items = [_problem(one) for one in findings[:_MOST_PROBLEMS]]
    if not items:
        return ""
    more = len(findings) - len(items)
    end = f"<p>{anchor(f'and {more} more', 'what-is-wrong')}</p>" if more > 0 else ""
    return f'<ul class="problems">{"".join(items)}</ul>{end}'


def _is_to_mend(finding: Mapping[str, Any], changed: Collection[str]) -> bool:
    """Whether it is to be mended by hand: not what the parameters that are loaded mend."""
    evidence = finding["evidence"]
    if finding["severity"] not in ("fail", "warning") or evidence.get("mended_by_parameter"):
        return False
    return evidence.get("parameter") not in changed


def _problem(finding: Mapping[str, Any]) -> str:
    cause = str(finding["id"]).removeprefix(_DIAGNOSED)
    place = f"cause-{cause}" if cause != finding["id"] else "told-and-shown"
    words, where = str(finding["found"]), ""
    if cause != finding["id"]:
        found, _, told = words.rpartition(" (")
        if found:
            words, where = found, told.rstrip(")")
    tail = f' <span class="quiet">{prose(where)}</span>' if where else ""
    mark = f'<span class="dot is-{escape(finding["severity"])}"></span>'
    hint = f'<span class="hidden">{escape(SEVERITY_WORDS[finding["severity"]])}: </span>'
    return f"<li>{mark}{hint}{anchor(words, place)}{tail}</li>"


def _is_known(value: object) -> bool:
    return isinstance(value, float | int) and value == value
