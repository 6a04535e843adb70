"""The table of all logs: what was refused, what was scored, and what does not count."""

import dataclasses
from pathlib import Path

from fusetune.report.results import read_results
from fusetune.report.sections.flight_sections import flights_section


def test_a_flight_that_is_scored_but_does_not_count_says_why(made: tuple[Path, str]) -> None:
    root, _ = made
    results = read_results(sorted((root / "analyze").iterdir()), root / "apply")
    rows = [dict(row) for row in results.decision["flights"]]
    last = next(row for row in rows if row["flight"] == "flight_4")
    last |= {"scored": False, "reason": "its replay has trust grade D"}
    decision = results.decision | {"flights": rows, "flights_scored": 4}
    html = flights_section(dataclasses.replace(results, decision=decision), root / "flights.parquet")
    assert "6 logs, 5 scored, 4 in the decision." in html
    (row,) = (part for part in html.split("<tr>") if "flight_4" in part)
    assert "not counted" in row
    assert "trust grade D" in row
    assert html.count("not counted") == 1
