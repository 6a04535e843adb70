"""What PX4 is told of the sensors, and what the flights say of them."""

from __future__ import annotations

from typing import Any

from fusetune.finding import from_documents
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.report.markup import Cell, details, number, paragraph, section, table
from fusetune.report.results import Results

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
    findings = from_documents(results.decision["findings"])
    noises = results.decision["noises"]
    if not findings and not noises:
        return ""
    parts = []
    if findings:
        rows = [(one.found, one.remedy) for one in findings]
        parts += [paragraph(_INTRODUCTION), table(("what PX4 is told, and what the flights say", "what to do"), rows)]
    else:
        parts.append(paragraph("Nothing shows that PX4 is told anything wrong of the sensors."))
    if noises:
        head = ("source", "unit", "flights", "told", "size of the error", "interval", "a filter may want")
        text = paragraph(_NOISES)
        parts.append(details("Every source", text, table(head, [_noise_row(one) for one in noises])))
    return section("What PX4 is told, and what the data say", *parts)


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
