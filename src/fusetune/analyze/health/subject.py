"""What rows of the health table are about, and how a figure becomes a row."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from fusetune.analyze.health.health_row import HealthRow, Origin
from fusetune.analyze.health.settings import Levels
from fusetune.finding import Finding, Severity


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

    def told(self, figure: str, words: str, value: float, unit: str = "", **more: Any) -> HealthRow:
        """A figure without a limit, or what is worth knowing."""
        return self.judged(figure, words, value, unit, Levels(math.inf), **more)

    def judged(
        self, figure: str, words: str, value: float, unit: str, levels: Levels, *, least: bool = False, **more: Any
    ) -> HealthRow:
        """A figure against its levels: worse is what lies above them or, with `least`, below.

        What is no number does not apply. `more` are fields of the finding: remedy, start_us, stop_us, evidence.
        """
        if not math.isfinite(value):
            return self.lacking(figure, f"{words}: not known")
        severity, crossed = _severity(value, levels, least)
        threshold = crossed if crossed is not None else next((one for one in levels if math.isfinite(one)), None)
        if severity == "pass":
            more.pop("remedy", None)
        for edge in ("start_us", "stop_us"):
            if more.get(edge) is not None:
                more[edge] = int(more[edge])
        said = f"{self.label}: {words} {_written(figure, value, unit)}"
        found = Finding(
            f"{self.name}.{figure}", severity, said, figure=float(value), threshold=threshold, unit=unit, **more
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
    return f"{value:.4g} {unit}".strip()
