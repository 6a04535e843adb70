"""The head of a flight's page: what is wrong, and what to do first; then each cause with its evidence."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from html import escape
from typing import Any

from fusetune.report.counted import count_words
from fusetune.report.flight_page.measured_words import figure_in_words
from fusetune.report.flight_results import Document, FlightResults
from fusetune.report.markup import bullets, details, number, paragraph, section, severity_mark
from fusetune.report.severity_words import SEVERITY_WORDS, FlightTimes, confidence_words, worst_of

_NAMED_ROWS = 3


def answer_section(results: FlightResults, is_shown: bool = False) -> str:
    """The answer in a box: the cause that explains most, when, how sure, what to do.

    Parameters
    ----------
    is_shown : whether the flight over time stands on the page, so that causes lead to where they hold
    """
    if not results.is_readable:
        return _box("warning", "This log cannot be read", _refusals(results, "Nothing can be told of the flight:"))
    if results.diagnoses:
        return _found(results, is_shown)
    if results.problems:
        return _unexplained(results)
    if results.refusals:
        title = "What this log tells is too little to say whether anything is wrong"
        return _box("warning", title, _less_told(results))
    title = "Nothing wrong was found on this flight"
    text = "No cause shows, and every figure of sensors and filter lies within its limit. What the log does not tell "
    return _box("pass", title, paragraph(text + "stands at the end of the health table."))


def _found(results: FlightResults, is_shown: bool) -> str:
    first, *others = results.diagnoses
    severity = worst_of(list(results.diagnoses))
    facts = _facts(first, results.times, is_shown) + _what_to_do(first)
    also = ""
    if others:
        also = "<p>Also: " + "; ".join(_heading(one) for one in others) + ".</p>"
    return _box(severity, _heading(first), facts, also, _beyond(results), _less_told(results))


def _beyond(results: FlightResults) -> str:
    """How much of the health table says that something is wrong, so that the two do not seem to contradict."""
    count = len({row["id"] for row in results.problems})
    if not count:
        return ""
    far = len({row["id"] for row in results.problems if row["severity"] == "fail"})
    verb = "lie" if count != 1 else "lies"
    text = f"{count_words(count, 'figure')} of sensors and filter {verb} beyond the limit"
    return paragraph(f"{text}{f', {far} far beyond it' if far else ''}: see the health table below.")


def _less_told(results: FlightResults) -> str:
    """Why a log that could be read is not replayed; empty of one that is."""
    if not results.refusals:
        return ""
    untold = f", and nothing of its {' and '.join(results.untold)}" if results.untold else ""
    return _refusals(results, f"This log cannot be replayed, so less can be told of the flight{untold}:")


def _refusals(results: FlightResults, text: str) -> str:
    reasons = [_sentence(one["found"]) + (f" {_sentence(one['remedy'])}" if one["remedy"] else "")
               for one in results.refusals]  # fmt: skip
    return paragraph(text) + bullets([one[:1].upper() + one[1:] for one in reasons])


def _unexplained(results: FlightResults) -> str:
    rows = results.problems
    count = len(rows)
    title = "Something is off, and no known cause explains it"
    if "diagnosis" in results.untold:
        title = "Something is off, and what causes it this log does not tell"
    text = f"{count} figure{'s lie' if count != 1 else ' lies'} beyond the limit. The first of them:"
    named = [
        _sentence(row["found"]) + (f" {row['remedy']}." if row["remedy"] else "")
        for row in results.problem_subjects[:_NAMED_ROWS]
    ]
    return _box(rows[0]["severity"], title, paragraph(text), bullets(named), _less_told(results))


def _box(severity: str, title: str, *parts: str) -> str:
    return f'<section class="decision is-{severity}"><h2>{title}</h2>{"".join(parts)}</section>'


def _heading(diagnosis: Document) -> str:
    """The cause with its severity beside."""
    severity = diagnosis["severity"]
    return f"{escape(diagnosis['cause'].strip().rstrip('.'))} {severity_mark(severity, SEVERITY_WORDS[severity])}"


def causes_section(results: FlightResults, is_shown: bool = False) -> str:
    """Each cause: what was seen, what the replay showed, values; empty where there is none."""
    if not results.diagnoses:
        return ""
    order = "What explains most of the trouble stands first." if len(results.diagnoses) > 1 else ""
    parts = [_cause(one, results.times, place == 0, is_shown) for place, one in enumerate(results.diagnoses)]
    causes = f'<div class="causes">{"".join(parts)}</div>'
    return section("Why", paragraph(order, "note") if order else "", causes, id="why")


def _cause(diagnosis: Document, times: FlightTimes, is_told: bool, is_shown: bool) -> str:
    """One cause; when, how sure and what to do are left out where the head of the page has told them."""
    seen = [one for one in diagnosis["evidence"] if one["origin"] != "replay"]
    replayed = [one for one in diagnosis["evidence"] if one["origin"] == "replay"]
    tried = diagnosis.get("experiment")
    parts = [
        "" if is_told else _facts(diagnosis, times, is_shown) + _what_to_do(diagnosis),
        _headed("What the log shows", bullets([_sign(one) for one in seen])),
        _headed("What the replay shows", bullets([_sign(one) for one in replayed])),
        details(
            "What was tried and measured",
            _headed("What was tried", paragraph(_sentence(_capital(tried["words"]))) if tried else ""),
            _headed("Values to set", bullets(list(_values_to_set(diagnosis["values"])))),
            _headed("Measured", bullets(list(_measured(diagnosis["values"])))),
            paragraph(f"The signs are known from: {diagnosis['source']}", "note") if diagnosis["source"] else "",
        ),
    ]
    kind = f"cause is-{diagnosis['severity']}"
    return (
        f'<div class="{kind}" id="cause-{escape(diagnosis["id"])}"><h3>{_heading(diagnosis)}</h3>{"".join(parts)}</div>'
    )


def _headed(title: str, inside: str) -> str:
    return f"<h4>{escape(title)}</h4>{inside}" if inside else ""


def _facts(diagnosis: Document, times: FlightTimes, is_shown: bool) -> str:
    since, until = diagnosis["since_s"], diagnosis["until_s"]
    when = escape(times.in_words(since, until))
    if is_shown:
        when = f'<a href="#viewer" data-state="t={since:.1f},{until:.1f}">{when}</a>'
    sure = escape(confidence_words(diagnosis["confidence"]))
    return f'<dl class="facts"><dt>when</dt><dd>{when}</dd><dt>how sure</dt><dd>{sure}</dd></dl>'


def _what_to_do(diagnosis: Document) -> str:
    return paragraph(_sentence(diagnosis["remedy"])) if diagnosis["remedy"] else ""


def _sign(sign: Mapping[str, Any]) -> str:
    """What was seen, with the level up to which it is usual, in the form in which the words tell the figure."""
    words = str(sign["words"]).rstrip(".").replace("%", " %").replace("  %", " %")
    figure, usual = sign["figure"], sign["usual"]
    if not all(map(_is_figure, (figure, usual))) or _is_named(usual, words):
        return words
    if sign["unit"] in ("", "1") and _is_named(100.0 * figure, words) and "%" in words:
        return f"{words} (usual: up to {number(100.0 * usual).text} %)"
    if not _is_named(figure, words):
        return words
    unit = "" if sign["unit"] == "1" else f" {sign['unit']}"
    return f"{words} (usual: up to {number(usual).text}{unit.rstrip()})"


def _is_figure(value: object) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)


def _is_named(value: float, words: str) -> bool:
    """Whether words tell a value already, as rounded as it may be."""
    # the 2 of EKF2_GYR_NOISE is no figure
    told = [one for one in re.findall(r"(?<![A-Za-z_\d.])-?\d+(?:\.\d+)?", words) if float(one)]
    return any(round(value, len(one.partition(".")[2])) == float(one) for one in told)


def _values_to_set(values: Mapping[str, float]) -> Iterator[str]:
    for name, value in values.items():
        if name.isupper():
            yield f"{name} = {number(value, 4).text}"


def _measured(values: Mapping[str, float]) -> Iterator[str]:
    for name, value in values.items():
        if not name.isupper() and value is not None:
            yield figure_in_words(name, value)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _sentence(text: str) -> str:
    """With a full stop."""
    text = text.strip()
    return text if text.endswith((".", "!", "?")) else f"{text}."
