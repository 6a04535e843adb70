"""How severe, how sure, and since when: in words for a pilot."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fusetune.analyze.diagnosis.diagnosis import how_sure
from fusetune.finding import Severity

WORST_FIRST: tuple[Severity, ...] = ("fail", "warning", "note", "pass", "does-not-apply")

SEVERITY_WORDS: Mapping[str, str] = {
    "fail": "do not fly like this",
    "warning": "mend it",
    "note": "worth knowing",
    "pass": "fine",
    "does-not-apply": "does not apply",
}
SEVERITY_COLOURS: Mapping[str, str] = {
    "fail": "#B03A00",
    "warning": "#E69F00",
    "note": "#56B4E9",
    "pass": "#7F8C99",
}
"""In pictures; page.css has the same for the text."""

_MOMENT_S = 0.1
"""What is shorter has no length to tell."""

_EDGE_S = 2.0
"""A cause that begins or ends so near to take-off or landing holds from or to there."""


@dataclass(frozen=True)
class FlightTimes:
    """Take-off and landing, seconds from the start of the log; NaN where the log does not tell."""

    take_off_s: float = math.nan
    landing_s: float = math.nan

    def in_words(self, since_s: float, until_s: float) -> str:
        """When a cause holds."""
        from_take_off = since_s <= self.take_off_s + _EDGE_S
        to_landing = until_s >= self.landing_s - _EDGE_S
        if from_take_off and to_landing:
            return "all of the flight"
        long = f"{until_s - since_s:.1f} s long"
        if from_take_off:
            return f"from take-off, {long}"
        if math.isfinite(self.take_off_s):
            start = f"{since_s - self.take_off_s:.1f} s after take-off"
        else:
            start = f"{since_s:.1f} s after the log began"
        if until_s - since_s < _MOMENT_S:
            return start
        return f"{start}, {'to landing' if to_landing else long}"


def rank(severity: str) -> int:
    """Place among severities, the worst first."""
    return WORST_FIRST.index(severity)  # type: ignore[arg-type]


def worst_of(findings: list[Mapping[str, Any]]) -> str:
    """The worst severity; "pass" of none."""
    return min((one["severity"] for one in findings), key=rank, default="pass")


def confidence_words(confidence: float) -> str:
    """How sure: a word for it, the same as in the terminal, with the figure."""
    return f"{how_sure(confidence)} ({100.0 * confidence:.0f} %)"


def cause_words(cause: str) -> str:
    """The id of a cause, readable."""
    return cause.replace("_", " ").replace("gnss", "GNSS").replace("imu", "IMU").replace("baro ", "barometer ")
