"""docs/health.md says what the table holds: every figure that it can have, and every limit."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.made_text import UpToDate

from fusetune.analyze.health.aid_source_rows import GROUP
from fusetune.analyze.health.health_table import health_rows
from fusetune.analyze.health.settings import HealthSettings
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.px4.flight import Flight
from fusetune.settings.declaration import declared


def limits_table() -> str:
    """Every setting with its default."""
    lines = ["| limit | default | unit | |", "|---|---|---|---|"]
    for one in declared(HealthSettings):
        values = one.default if isinstance(one.default, tuple) else (one.default,)
        default = ", ".join(f"{value:g}" for value in values)
        lines.append(f"| `{one.name}` | {default} | {one.declaration.unit} | {one.declaration.meaning} |")
    return "\n".join(lines)


def test_the_limits_are_those_of_the_code(project_root: Path, up_to_date: UpToDate) -> None:
    up_to_date(project_root / "docs" / "health.md", "limits", f"\n{limits_table()}\n\n")


def named(page: str, rows: object) -> None:
    for row in rows:  # type: ignore[attr-defined]
        subject, figure = row.finding.id.split(".")
        assert f"`{figure}`" in page, row.finding.id
        assert row.group == GROUP or f"`{subject}`" in page, row.finding.id


def test_every_figure_of_a_simulated_flight_is_explained(project_root: Path, survey_flight: Flight) -> None:
    named((project_root / "docs" / "health.md").read_text(), health_rows(ObservedFlight(survey_flight)))


@pytest.mark.parametrize("name", ["Chainplain", "PX4__ekf_failure", "Auterion__quadrotor_local"])
def test_every_figure_of_a_real_flight_is_explained(project_root: Path, told, name: str) -> None:
    named((project_root / "docs" / "health.md").read_text(), told(name).rows)
