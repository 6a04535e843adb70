"""What rows of the health table are about, and how a figure becomes a row."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.health.health_row import HealthRow, Origin
from fusetune.analyze.health.settings import Levels
from fusetune.finding import Evidence, Finding, Severity

_WHOLE_BELOW = 1e9


@dataclass(frozen=True)
class Subject:
    """A source, sensor or part of the filter that several figures belong to.

    Attributes
    ----------
    name : before the point of the ids of its rows
    label : for people
    group, instance, origin : of its rows
    """

    name: str
    label: str
    group: str
    instance: int | None = None
    origin: Origin = "vehicle"

    def told(
        self,
        figure: str,
        words: str,
        value: float,
        unit: str = "",
        *,
        when: Interval | None = None,
        evidence: Evidence | None = None,
    ) -> HealthRow:
        """A figure without a limit."""
        return self.judged(figure, words, value, unit, Levels(math.inf), when=when, evidence=evidence)

    def judged(
        self,
        figure: str,
        words: str,
        value: float,
        unit: str,
        levels: Levels,
        *,
        least: bool = False,
        remedy: str = "",
        when: Interval | None = None,
        evidence: Evidence | None = None,
    ) -> HealthRow:
        """A figure against its levels: worse is what lies above them or, with `least`, below.

        What is no number does not apply. The remedy is told of a warning or a failure, `when` is µs.
        """
        if not math.isfinite(value):
            return self.lacking(figure, f"{words}: not known")
        severity, crossed = _severity(value, levels, least)
        threshold = crossed if crossed is not None else next((one for one in levels if math.isfinite(one)), None)
        start, stop = when or (None, None)
        found = Finding(
            f"{self.name}.{figure}",
            severity,
            f"{self.label}: {words} {_written(figure, value, unit)}",
            remedy if severity != "pass" else "",
            float(value),
            threshold,
            unit,
            start,
            stop,
            evidence or {},
        )
        return HealthRow(found, self.group, self.instance, self.origin)

    def lacking(self, figure: str, why: str) -> HealthRow:
        """A figure that the flight does not tell."""
        found = Finding(f"{self.name}.{figure}", "does-not-apply", f"{self.label}: {why}")
        return HealthRow(found, self.group, self.instance, self.origin)


def _severity(value: float, levels: Levels, least: bool) -> tuple[Severity, float | None]:
    """Severity of a figure, and the level that it crossed."""
    if _is_beyond(value, levels.fail, least):
        return "fail", levels.fail
    if _is_beyond(value, levels.warning, least):
        return "warning", levels.warning
    return "pass", None


def _is_beyond(value: float, level: float, least: bool) -> bool:
    return math.isfinite(level) and (value < level if least else value > level)


def _written(figure: str, value: float, unit: str) -> str:
    if figure.endswith("_share") and not unit:
        return f"{100.0 * value:.3g} %"
    # flags and counts, which four digits would round
    digits = ".0f" if float(value).is_integer() and abs(value) < _WHOLE_BELOW else ".4g"
    return f"{value:{digits}} {unit}".strip()
