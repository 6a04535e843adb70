"""What PX4 is told of the sensors, and what the flights say of them."""

from __future__ import annotations

from typing import Any

from fusetune.finding import from_documents
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.report.markup import Cell, Html, details, number, paragraph, section, severity_mark, table
from fusetune.report.results import Results
from fusetune.report.severity_words import SEVERITY_WORDS

_OF_HEALTH = "diagnosis."
"""What is wrong with the vehicle stands in its health."""

_INTRODUCTION = (
    "Told by the flights themselves, whichever set is chosen. A value to compare is no advice to fly: noises act "
    "together, and only a study of them shows what they do. results/apply/candidates.yaml holds such sets as a study."
)
_NOISES = (
    "The size of a source's error is its white noise and what wanders within 3 s (velocities) or 10 s (all else); the "
    "interval begins at the white noise alone, for what wanders cannot be told from the drift of the inertial "
    "solution. As a filter takes errors for white, one that wanders may have to be told as a larger one: the last "
    "column."
)


def findings_section(results: Results) -> str:
    """What was found about sensors, the noises behind a click; empty where nothing is known."""
    told = [one for one in results.decision["findings"] if not one["id"].startswith(_OF_HEALTH)]
    findings = from_documents(told)
    noises = results.decision["noises"]
    if not findings and not noises:
        return ""
    parts = []
    if findings:
        rows = [
            (
                Html(severity_mark(one.severity, SEVERITY_WORDS[one.severity]), "short"),
                Cell(one.found, "said"),
                one.remedy,
            )
            for one in findings
        ]
        head = ("", "what PX4 is told, and what the flights say", "what to do")
        parts += [paragraph(_INTRODUCTION, "note"), table(head, rows, kind="cards findings")]
    if noises:
        columns = ("source", "unit", "flights", "told", "size of the error", "interval", "a filter may want")
        text = paragraph(_NOISES)
        parts.append(details("Noise of every source", text, table(columns, [_noise_row(one) for one in noises])))
    return section("What PX4 is told, and what the data say", *parts, id="told-and-shown")


def _noise_row(noise: dict[str, Any]) -> tuple[str | Cell, ...]:
    source = AID_SOURCES[noise["source"]]
    bound = noise["is_bound"]
    return (
        source.label,
        Cell(source.unit, "quiet"),
        number(noise["flights"]),
        number(noise["told"], 2),
        Cell("not known", "quiet") if bound else number(noise["size"], 2),
        f"at most {noise['upper']:.2g}" if bound else f"{noise['lower']:.2g} to {noise['upper']:.2g}",
        Cell("not known", "quiet") if bound else number(noise["wanted"], 2),
    )
