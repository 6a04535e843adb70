"""What was found on a flight as bars over its time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from fusetune.report.figure_words import figure_words
from fusetune.report.flight_results import FlightResults
from fusetune.report.severity_words import cause_words

_MOST_FIGURES = 8


@dataclass(frozen=True)
class Bar:
    """A finding over time, s from the start of the log."""

    words: str
    severity: str
    since_s: float
    until_s: float
    is_cause: bool = True


def finding_bars(results: FlightResults) -> Iterator[Bar]:
    """Causes, and behind them the figures beyond their limits whose time is known."""
    for one in results.diagnoses:
        yield Bar(cause_words(one["id"]), one["severity"], one["since_s"], one["until_s"])
    timed = [(row, when) for row in results.problem_subjects if (when := results.since_start_s(row)) is not None]
    for row, when in timed[:_MOST_FIGURES]:
        yield Bar(figure_words(row["id"]), row["severity"], *when, is_cause=False)
