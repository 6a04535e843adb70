"""What is wrong, by finding: how severe, on which flights, how sure, what to do; the worst first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from fusetune.report.counted import count_words
from fusetune.report.markup import Html, details, link, paragraph, prose, section, severity_mark, table
from fusetune.report.sections.flights_section import Logs
from fusetune.report.severity_words import SEVERITY_WORDS, cause_words, confidence_words, rank

Document = Mapping[str, Any]

_MOST_LINKS = 12
_MOST_ROWS = 8
"""More findings are behind a click."""


def health_answer(logs: Logs) -> str:
    """How many flights show what must be mended, in a sentence and a bar."""
    counts = Counter(_worst(logs, name) for name in logs.verdicts)
    total = count_words(len(logs.verdicts), "log")
    if counts["fail"]:
        title = f"{counts['fail']} of {total} show what must be mended before flying again"
    elif counts["warning"]:
        title = f"{counts['warning']} of {total} show something to mend"
    elif counts["untold"] == len(logs.verdicts):
        title = "These logs tell too little to say whether anything is wrong"
    else:
        title = f"No cause of trouble shows on {len(logs.verdicts) - counts['untold']} of {total}"
    return f'<div class="answer-line"><h2>{escape(title)}</h2>{_bar(counts, len(logs.verdicts))}</div>'


_BAR = {"fail": "do not fly like this", "warning": "mend it", "note": "worth knowing", "pass": "nothing found",
        "untold": "tells too little"}  # fmt: skip


def _worst(logs: Logs, name: str) -> str:
    """Worst severity on a flight; "untold" of a refused log without a finding."""
    findings = logs.findings(name)
    if findings:
        return min((str(one["severity"]) for one in findings), key=rank)
    diagnosis = logs.diagnoses.get(name)
    return "untold" if diagnosis is None or diagnosis["refused"] else "pass"


def _bar(counts: Mapping[str, int], total: int) -> str:
    told = [(kind, words, counts.get(kind, 0)) for kind, words in _BAR.items() if counts.get(kind, 0)]
    at, marks = 0.0, []
    for kind, words, count in told:
        width = 100.0 * count / total
        marks.append(
            f'<rect class="mark-{kind}" x="{at:.3f}" y="0" width="{max(width - 0.4, 0.1):.3f}" height="10">'
            f"<title>{escape(f'{words}: {count}')}</title></rect>"
        )
        at += width
    legend = "".join(
        f'<li><span class="dot is-{kind}"></span>{escape(words)} <b>{count}</b></li>' for kind, words, count in told
    )
    shape = 'viewBox="0 0 100 10" preserveAspectRatio="none" aria-hidden="true"'
    return f'<svg class="share-bar" {shape}>{"".join(marks)}</svg><ul class="legend">{legend}</ul>'


def health_section(logs: Logs) -> str:
    """A row per finding with links to its flights; then, in a line per reason, logs that tell nothing."""
    found: dict[str, list[tuple[str, Document]]] = {}
    for name in logs.verdicts:
        for one in logs.findings(name):
            found.setdefault(str(one["id"]), []).append((name, one))

    def order(item: tuple[str, list[tuple[str, Document]]]) -> tuple[int, int, str]:
        cause, flights = item
        return rank(_worst_of(flights)), -len(flights), cause

    rows = [_row(cause, flights, logs) for cause, flights in sorted(found.items(), key=order)]
    head = ("", "what is wrong", "flights", "how sure", "what to do")
    told = table(head, rows[:_MOST_ROWS], kind="cards findings")
    rest = rows[_MOST_ROWS:]
    more = details(count_words(len(rest), "more finding"), table(head, rest, kind="cards findings"))
    text = paragraph("No parameter cures what is broken: mend it first, then tune.", "note") if rows else ""
    return section("What is wrong", text, told, more, _untold(logs), id="what-is-wrong")


def _worst_of(flights: Sequence[tuple[str, Document]]) -> str:
    return min((str(one["severity"]) for _, one in flights), key=rank)


def _row(cause: str, flights: Sequence[tuple[str, Document]], logs: Logs) -> tuple[Html, ...]:
    worst = _worst_of(flights)
    name, first = max(flights, key=lambda item: (-rank(item[1]["severity"]), item[1]["confidence"]))
    alike = len({one["cause"] for _, one in flights}) == 1
    where = "" if alike else f'<p class="note">{prose(f"on {name}: {_sentence(first)}")}</p>'
    title = _sentence(first) if alike else f"{cause_words(cause)[:1].upper()}{cause_words(cause)[1:]}"
    remedies = Counter(str(one["remedy"]) for _, one in flights if one["remedy"])
    remedy = first["remedy"] or (remedies.most_common(1)[0][0] if remedies else "")
    other = '<p class="note">On other flights in other words: see their pages.</p>' if len(remedies) > 1 else ""
    return (
        Html(severity_mark(worst, SEVERITY_WORDS[worst]), "short"),
        Html(f'<strong id="cause-{escape(cause)}">{prose(title)}</strong>{where}', "said"),
        Html(_links(cause, [name for name, _ in flights], logs), "said"),
        Html(_how_sure([float(one["confidence"]) for _, one in flights]), "short"),
        Html(f"{prose(str(remedy))}{other}", "advice"),
    )


def _sentence(finding: Document) -> str:
    return str(finding["cause"]).strip().rstrip(".")


def _how_sure(confidences: Sequence[float]) -> str:
    low, high = min(confidences), max(confidences)
    if round(100.0 * low) == round(100.0 * high):
        return prose(confidence_words(high))
    return prose(f"{100.0 * low:.0f} to {100.0 * high:.0f} %")


def _links(cause: str, names: Sequence[str], logs: Logs) -> str:
    count = f"<b>{count_words(len(names), 'flight')}</b>: "
    told = [
        link(name, logs.pages[name], f"cause-{cause}") if name in logs.pages else escape(name)
        for name in names[:_MOST_LINKS]
    ]
    more = len(names) - _MOST_LINKS
    return count + ", ".join(told) + (f" and {more} more" if more > 0 else "")


def _untold(logs: Logs) -> str:
    """Logs that tell nothing, or too little to find anything wrong, by why."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for name, one in logs.diagnoses.items():
        if one["refused"] and not one["diagnoses"]:
            told = "; ".join(reason["found"] for reason in one["refused"])
            remedy = "; ".join(dict.fromkeys(reason["remedy"] for reason in one["refused"] if reason["remedy"]))
            reasons.setdefault((told, remedy), []).append(name)
    count = sum(map(len, reasons.values()))
    rows = [
        (Html(", ".join(link(one, logs.pages[one]) if one in logs.pages else escape(one) for one in names)), *why)
        for why, names in reasons.items()
    ]
    verb = "tell" if count != 1 else "tells"
    text = f"{count_words(count, 'log')} {verb} too little to say whether anything is wrong"
    return details(text, table(("logs", "why not", "what to do"), rows, kind="cards"))
