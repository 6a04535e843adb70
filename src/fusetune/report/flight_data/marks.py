"""What was found on a flight, as marks in time that can be jumped to."""

from __future__ import annotations

from collections.abc import Iterator

from fusetune.report.flight_data.content import Mark
from fusetune.report.flight_results import FlightResults


def marks(results: FlightResults) -> Iterator[Mark]:
    """Causes first, then of each source or sensor that is beyond its limit the worst figure, if it has a time."""
    for one in results.diagnoses:
        yield Mark(one["id"], one["severity"], one["cause"], float(one["since_s"]), float(one["until_s"]))
    for row in results.problem_subjects:
        when = results.since_start_s(row)
        if when is not None:
            yield Mark(row["id"], row["severity"], row["found"], *when)
