"""Which flight shows which cause."""

from __future__ import annotations

from html import escape

from fusetune.report.counted import count_words
from fusetune.report.fleet.fleet_results import Document, FleetResults
from fusetune.report.markup import details, link, paragraph
from fusetune.report.severity_words import SEVERITY_WORDS, cause_words, confidence_words, worst_of

_MOST_CLEAN_SHOWN = 12
"""More flights without any trouble are behind a click."""


def matrix_section(results: FleetResults) -> str:
    """Flights, worst first, against causes, the most frequent first; with a link to each flight's page."""
    flights = results.worst_first
    clean = [one for one in flights if not results.has_trouble(one)]
    shown = [one for one in flights if one not in clean] if len(clean) > _MOST_CLEAN_SHOWN else list(flights)
    text = (
        "Red: the flight must not be repeated like this. Orange: something is to be mended. Blue: worth knowing. Where "
        "the pointer rests it says how sure. Beside: how many figures of health lie beyond their limits, far (fail) "
        "and near (warn). Of a refused log little or nothing can be told; its page says why."
    )
    parts = [paragraph(text, "note")]
    if shown:
        parts.append(_table(shown, results))
    if len(shown) < len(flights):
        parts.append(details(f"{count_words(len(clean), 'flight')} without any trouble", _table(clean, results)))
    return details("Which flights have what", *parts, id="matrix")


def _table(flights: list[Document], results: FleetResults) -> str:
    causes = [one["id"] for one in results.causes]
    titles = '<th scope="col">flight</th>'
    titles += "".join(f'<th scope="col" class="turned"><span>{escape(cause_words(one))}</span></th>' for one in causes)
    titles += '<th scope="col" class="number">fail</th><th scope="col" class="number">warn</th>'
    titles += "".join(f'<th scope="col">{title}</th>' for title in ("date", "vehicle", "firmware"))
    rows = "".join(f"<tr>{_row(one, causes, results)}</tr>" for one in flights)
    return (
        f'<div class="scroll"><table class="matrix"><thead><tr>{titles}</tr></thead><tbody>{rows}</tbody></table></div>'
    )


def _row(flight: Document, causes: list[str], results: FleetResults) -> str:
    name, counts = flight["name"], flight["counts"]
    title = link(name, results.links[name]) if name in results.links else escape(name)
    words = (flight["date"][:10], flight["vehicle"], flight["firmware"])
    told = "".join(f'<td class="short">{escape(one or "–")}</td>' for one in words)
    found = {one["id"]: one for one in reversed(flight["findings"])}
    marks = "".join(_mark(found.get(cause)) for cause in causes)
    numbers = "".join(_count(counts[severity], severity) for severity in ("fail", "warning"))
    if flight["refused"]:
        reasons = escape("; ".join(flight["refused"]))
        title += f' <span class="quiet" title="{reasons}">(refused)</span>'
    return f'<td class="short">{title}</td>{marks}{numbers}{told}'


def _count(count: int, severity: str) -> str:
    return f'<td class="number is-{severity}">{count or ""}</td>'


def _mark(finding: Document | None) -> str:
    if finding is None:
        return '<td class="mark"></td>'
    severity = worst_of([finding])
    hint = f"{finding['cause']} – {SEVERITY_WORDS[severity]}, {confidence_words(finding['confidence'])}"
    words = f'<span class="hidden">{escape(SEVERITY_WORDS[severity])}</span>'
    return f'<td class="mark" title="{escape(hint)}"><span class="spot is-{severity}"></span>{words}</td>'
