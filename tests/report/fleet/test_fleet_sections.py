"""What all flights show together: matrix, changes, odd flights, verdicts, spreads."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from tests.apply.fleet.made_fleet import date, found, made_diagnosis, row, write_health_rows
from tests.report.read_page import told

from fusetune.apply.fleet import changes as module
from fusetune.apply.fleet.fleet import write_fleet
from fusetune.report.fleet.fleet_results import FleetResults, read_fleet_results
from fusetune.report.fleet.matrix import matrix_section
from fusetune.report.fleet.statistics_sections import (
    changes_section,
    figures_section,
    outliers_section,
    untold,
    verdicts_section,
)
from fusetune.storage.documents import write_document

FLIGHTS = 24
CHANGED = 14


def made_fleet(root: Path, rows: list[dict], diagnoses: dict[str, list[dict] | dict]) -> FleetResults:
    health = write_health_rows(root / "analyze" / "health.parquet", rows)
    files = [root / "analyze" / flight / "diagnosis.json" for flight in diagnoses]
    for file, one in zip(files, diagnoses.values(), strict=True):
        file.parent.mkdir(parents=True)
        write_document(file, one if isinstance(one, dict) else made_diagnosis(file.parent.name, one))
    (root / "apply").mkdir()
    write_fleet(health, files, root / "apply" / "fleet.json")
    links = {flight: f"report/flights/{flight}.html" for flight in diagnoses}
    return read_fleet_results(root / "apply" / "fleet.json", health, links)


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> FleetResults:
    """A vehicle whose accuracy is worse from one flight on, with another firmware; one flight fails alone."""
    draw = np.random.default_rng(4)
    rows = []
    for place in range(FLIGHTS):
        name = "<odd>" if place == 3 else f"flight_{place}"
        told = {"date": date(place), "firmware": "v1.15.4" if place < CHANGED else "v1.16.0"}
        eph = float(draw.normal(1.0, 0.1)) + (1.5 if place >= CHANGED else 0.0)
        rows += [
            row(name, "gnss.eph", eph, threshold=3.0, **told),
            row(name, "gnss.epv", float(draw.normal(2.0, 0.1)), threshold=5.0, **told),
            row(name, "imu.rate_hz", 40.0 if place == 3 else float(draw.normal(200.0, 5.0)), unit="Hz", group="sensor",
                threshold=100.0, severity="fail" if place == 3 else "pass", **told),
        ]  # fmt: skip
    diagnoses = {
        "flight_1": [found("vibration", "warning", 0.7)],
        "flight_2": [found("vibration", "fail", 0.9), found("gnss_delay", "note")],
        "flight_5": [],
    }
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(module, "SHUFFLES", 499)
        return made_fleet(tmp_path_factory.mktemp("results"), rows, diagnoses)


def test_flights_stand_against_causes_with_links_to_their_pages(fleet: FleetResults) -> None:
    matrix = matrix_section(fleet)
    rows = matrix.split("<tr>")[2:]
    assert [re.sub(r"<[^>]+>", "", one.split("</td>")[0]) for one in rows[:3]] == [
        "flight_2",
        "flight_1",
        "&lt;odd&gt;",
    ]
    assert '<a href="report/flights/flight_2.html">' in rows[0]
    # causes by severity: vibration, then the delay
    assert re.findall(r"spot (is-\w+)", rows[0]) == ["is-fail", "is-note"]
    assert re.findall(r"spot (is-\w+)", rows[1]) == ["is-warning"]
    assert "It is vibration – do not fly like this, sure (90 %)" in rows[0]
    assert "21 flights without any trouble" in matrix
    assert "<odd>" not in matrix


def test_a_change_tells_from_when_on_and_is_drawn(fleet: FleetResults) -> None:
    section = changes_section(fleet)
    assert f"From flight_{CHANGED} ({date(CHANGED)[:10]}, with another firmware) on" in told(section)
    assert "GNSS: horizontal accuracy" in told(section)
    assert section.count("<svg") == 2, "the figure that changed, and the one that fails on a flight"


def test_an_odd_flight_is_named_with_its_figures(fleet: FleetResults) -> None:
    words = told(outliers_section(fleet))
    assert "&lt;odd&gt;: IMU: samples a second" in words
    assert "fail" in words


def test_a_verdict_that_hangs_on_one_flight_says_on_which(fleet: FleetResults) -> None:
    verdicts = told(verdicts_section(fleet))
    assert "&lt;odd&gt; 1 IMU: samples a second" in verdicts
    assert "IMU: samples a second fail pass 24 1 0 &lt;odd&gt;" in verdicts


def test_every_figure_is_in_the_tables_and_those_that_are_spread_are_drawn(fleet: FleetResults) -> None:
    section = figures_section(fleet)
    words = told(section)
    for name in ("GNSS: horizontal accuracy", "GNSS: vertical accuracy", "IMU: samples a second"):
        assert name in words
    assert "How those beyond their limits are spread" in words
    assert "results/analyze/health.parquet" in words


def test_of_what_shows_nothing_there_is_a_line_and_no_section(tmp_path: Path) -> None:
    fleet = made_fleet(tmp_path, [row("only", "gnss.eph", 1.0)], {"only": []})
    assert changes_section(fleet) == outliers_section(fleet) == verdicts_section(fleet) == ""
    assert [line.split(" (")[0] for line in untold(fleet)] == [
        "No figure of a vehicle changed over time beyond chance",
        "No flight differs from the others of its vehicle",
        "On no flight does a figure lie beyond its limit.",
    ]


def test_no_flights_and_refused_ones_have_a_matrix(tmp_path: Path) -> None:
    assert "<table" not in matrix_section(made_fleet(tmp_path / "none", [], {}))
    rows = [row(name, "gnss.eph", 1.0, threshold=3.0) for name in ("slow", "x")]
    diagnoses = {
        "slow": made_diagnosis("slow", [], "the IMU is logged at 20 Hz"),
        "x": made_diagnosis("x", [], "the log is empty", readable=False),
    }
    matrix = matrix_section(made_fleet(tmp_path / "refused", rows, diagnoses))
    assert matrix.count("(refused)") == 2
    assert 'title="the IMU is logged at 20 Hz"' in matrix
