"""A check: a question that is put to a flight, declared beside the function that answers it.

::

    @check(topics=("vehicle_land_detected",), thresholds=("low_airborne_s",), unit="s")
    def airborne(judged: JudgedFlight) -> Finding:
        \"\"\"Time in the air.\"\"\"
        ...
        return airborne.passed(f"airborne for {seconds:.0f} s", seconds, judged.limits.low_airborne_s)

The name of the function is the id of its findings, the first line of its docstring what the check looks at. A check
that is declared runs nowhere yet: a list apart from the checks says which of them run, and in which order.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypedDict, TypeVar, Unpack

from fusetune.finding import Evidence, Finding, Severity

Subject = TypeVar("Subject")
"""What a check looks at: a flight, with what the checks of a room share."""


class Details(TypedDict, total=False):
    """What a finding may have besides words, remedy, figure and threshold; `unit` in place of the check's own."""

    unit: str
    start_us: int
    stop_us: int
    evidence: Evidence


@dataclass(frozen=True)
class Check(Generic[Subject]):
    """One check, and the findings that it can make.

    Attributes
    ----------
    id : of its findings
    looks_at : in words
    topics : that it reads, of a flight in the layout of `fusetune.px4.layouts.release_layouts.canonical`
    thresholds : names of the settings that it uses
    unit : of figure and threshold
    look : answers with one finding, or with several that each have their time
    """

    id: str
    looks_at: str
    topics: tuple[str, ...]
    thresholds: tuple[str, ...]
    unit: str
    look: Callable[[Subject], Finding | Sequence[Finding]]

    def findings(self, subject: Subject) -> tuple[Finding, ...]:
        """What it finds."""
        answer = self.look(subject)
        return (answer,) if isinstance(answer, Finding) else tuple(answer)

    def does_not_apply(self, found: str) -> Finding:
        """Nothing is there that could be looked at."""
        return Finding(self.id, "does-not-apply", found)

    def passed(
        self, found: str, figure: float | None = None, threshold: float | None = None, **details: Unpack[Details]
    ) -> Finding:
        """As it should be."""
        return self._finding("pass", found, "", figure, threshold, details)

    def warned(
        self,
        found: str,
        remedy: str,
        figure: float | None = None,
        threshold: float | None = None,
        **details: Unpack[Details],
    ) -> Finding:
        """What lessens the worth of the flight."""
        return self._finding("warning", found, remedy, figure, threshold, details)

    def failed(
        self,
        found: str,
        remedy: str,
        figure: float | None = None,
        threshold: float | None = None,
        **details: Unpack[Details],
    ) -> Finding:
        """What makes the flight unfit."""
        return self._finding("fail", found, remedy, figure, threshold, details)

    def _finding(
        self,
        severity: Severity,
        found: str,
        remedy: str,
        figure: float | None,
        threshold: float | None,
        details: Details,
    ) -> Finding:
        unit = "" if figure is None else self.unit
        return replace(Finding(self.id, severity, found, remedy, figure, threshold, unit), **details)


def check(
    *, topics: Sequence[str] = (), thresholds: Sequence[str] = (), unit: str = ""
) -> Callable[[Callable[[Subject], Finding | Sequence[Finding]]], Check[Subject]]:
    """Make a check of a function, which then goes by the function's name; all else as for `Check`."""

    def declared(look: Callable[[Subject], Finding | Sequence[Finding]]) -> Check[Subject]:
        looks_at = (inspect.getdoc(look) or "").partition("\n")[0]
        return Check(look.__name__, looks_at, tuple(topics), tuple(thresholds), unit, look)

    return declared
