"""How far the replay of each flight can be trusted, in words: the replay of its own parameters against its own log."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fusetune.report.markup import Cell, details, number, paragraph, section, table

LEVEL_LABELS = {"same": "repeats the flight", "close": "close", "rough": "rough", "poor": "poor"}
LEVEL_KINDS = {"same": "good", "close": "good", "rough": "", "poor": "bad"}
GRADE_KINDS = {"A": "good", "B": "good", "C": "", "D": "bad"}
FIGURE_WORDS = {
    "innovation_factor": "size of innovations, replay to vehicle",
    "velocity_m_s": "horizontal velocity, RMS difference, m/s",
    "heading_deg": "heading, RMS difference, °",
    "flags_equal": "flags alike, share of time",
}
INTRODUCTION = (
    "Each flight was also replayed with the parameters it flew, and the result set beside what the vehicle's own "
    "estimator logged. Where the two agree, the replay knows this vehicle; where they do not, the reasons say what the "
    "log lacks."
)


def trust_section(analyze_folders: Sequence[Path]) -> str:
    """Table of all flights, and the figures of each behind a click; empty where no flight was compared."""
    found = [file for folder in analyze_folders if (file := Path(folder) / "fidelity.json").exists()]
    flights = [json.loads(file.read_text(encoding="utf-8")) for file in found]
    if not flights:
        return ""
    head = ("flight", "grade", "replay", "median difference", "in words", "why not closer")
    rows = [
        (
            flight["flight"],
            Cell(flight.get("grade", "–"), GRADE_KINDS.get(flight.get("grade", ""), "")),
            Cell(LEVEL_LABELS.get(flight["level"], "not compared"), LEVEL_KINDS.get(flight["level"], "")),
            _percent(flight["median_relative_rms"]),
            flight["words"],
            "; ".join(filter(None, [flight.get("trust", {}).get("reason", ""), *flight["reasons"]])) or "–",
        )
        for flight in flights
    ]
    parts = [details(f"{flight['flight']}: figures", _figures(flight)) for flight in flights if flight["axes"]]
    parts += [details(f"{flight['flight']}: grade", _grade(flight["trust"])) for flight in flights if "trust" in flight]
    return section("How far the replay can be trusted", paragraph(INTRODUCTION), table(head, rows), *parts)


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.0%}"


def _grade(trust: dict[str, Any]) -> str:
    """What the grade follows from: figures of the log as it is and of the replay in use, and what each cause costs."""
    groups = sorted({*trust["as_logged"]["innovation_ratio"], *trust["repaired"]["innovation_ratio"]})
    rows: list[tuple[str | Cell, ...]] = [
        (f"innovations of {group.replace('_', ' ')}, RMS ratio", *_both(trust, "innovation_ratio", group), "–")
        for group in groups
    ]
    rows += [
        (words, *_both(trust, name), trust["figure_grades"].get(name, "–"))
        for name, words in FIGURE_WORDS.items()
        if name != "innovation_factor"
    ]
    causes = [
        (
            cause["cause"],
            "yes" if cause["repaired"] else "no",
            number(cause["cost"]),
            "by switching it" if cause["measured"] else "what remains",
        )
        for cause in trust["causes"]
    ]
    head = (f"grade {trust['grade']} (as logged: {trust['as_logged_grade']})", "as logged", "replay in use", "grade")
    parts = [paragraph(trust["words"]), paragraph(f"Start: {trust['start']}."), table(head, rows)]
    if causes:
        parts.append(table(("cause", "repaired", "cost", "found"), causes))
    return "".join(parts)


def _both(trust: dict[str, Any], name: str, group: str = "") -> tuple[str | Cell, str | Cell]:
    values = [trust[kind][name].get(group) if group else trust[kind][name] for kind in ("as_logged", "repaired")]
    first, second = ("–" if value is None else number(value) for value in values)
    return first, second


def _figures(flight: dict[str, Any]) -> str:
    head = (
        "source", "axis", "samples", "difference / RMS", "RMS ratio", "variance ratio", "fused alike", "rejected alike",
        "NLL difference",
    )  # fmt: skip
    rows = [
        (
            axis["source"],
            str(axis["axis"]),
            str(axis["samples"]),
            _percent(axis["relative_rms"]),
            number(axis["rms_ratio"]),
            number(axis["variance_ratio"]),
            _percent(axis["fused_equal"]),
            _percent(axis["rejected_equal"]),
            number(axis["nll_difference"]),
        )
        for axis in flight["axes"]
    ]
    return table(head, rows)
