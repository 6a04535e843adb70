"""How far the replay of each flight can be trusted, in words: the replay of its own parameters against its own log."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fusetune.report.markup import Cell, details, number, paragraph, section, table

LEVEL_LABELS = {"same": "repeats the flight", "close": "close", "rough": "rough", "poor": "poor"}
LEVEL_KINDS = {"same": "good", "close": "good", "rough": "", "poor": "bad"}
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
    head = ("flight", "replay", "median difference", "in words", "why not closer")
    rows = [
        (
            flight["flight"],
            Cell(LEVEL_LABELS.get(flight["level"], "not compared"), LEVEL_KINDS.get(flight["level"], "")),
            _percent(flight["median_relative_rms"]),
            flight["words"],
            "; ".join(flight["reasons"]) or "–",
        )
        for flight in flights
    ]
    parts = [details(f"{flight['flight']}: figures", _figures(flight)) for flight in flights if flight["axes"]]
    return section("How far the replay can be trusted", paragraph(INTRODUCTION), table(head, rows), *parts)


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.0%}"


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
