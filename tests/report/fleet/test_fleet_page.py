"""The page of all flights."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from tests.apply.fleet.made_fleet import date, found, made_diagnosis, row, write_health_rows

from fusetune.apply.fleet import changes as module
from fusetune.apply.fleet.fleet import write_fleet
from fusetune.report.fleet_page.page import build_fleet_page
from fusetune.storage.documents import write_document

FLIGHTS = 24
CHANGED = 14


def made_page(root: Path, rows: list[dict], diagnoses: dict[str, list[dict] | dict]) -> str:
    health = write_health_rows(root / "analyze" / "health.parquet", rows)
    files = [root / "analyze" / flight / "diagnosis.json" for flight in diagnoses]
    for file, one in zip(files, diagnoses.values(), strict=True):
        file.parent.mkdir(parents=True)
        write_document(file, one if isinstance(one, dict) else made_diagnosis(file.parent.name, one))
    (root / "apply").mkdir()
    write_fleet(health, files, root / "apply" / "fleet.json")
    pages = [root / "report" / "flights" / f"{flight}.html" for flight in diagnoses]
    build_fleet_page(root / "apply" / "fleet.json", health, root / "report" / "fleet", root / "fleet.html", pages)
    return (root / "fleet.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
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
        return made_page(tmp_path_factory.mktemp("results"), rows, diagnoses)


def told(page: str) -> str:
    body = re.sub(r'src="data:[^"]*"', "", page.partition("<body>")[2] or page)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", body).replace("&nbsp;", " "))


def test_the_answer_names_the_worst_the_change_and_the_odd_flight(page: str) -> None:
    answer = told(page[: page.index("Which flights have what")])
    assert "1 of 24 flights show what must be mended before flying again" in answer
    assert "Vibration (do not fly like this) on 2 flights: flight_1, flight_2." in answer
    assert answer.index("Vibration") < answer.index("GNSS delay (worth knowing) on 1 flight: flight_2.")
    assert f"From flight_{CHANGED} ({date(CHANGED)[:10]}, with another firmware) on" in answer
    assert "GNSS: horizontal accuracy was" in answer
    assert "&lt;odd&gt; stands out most from the flights of its vehicle, in 1 figure." in answer
    assert "21 logs without a diagnosis, unreadable or too damaged" in answer


def test_flights_stand_against_causes_with_links_to_their_pages(page: str) -> None:
    matrix = page[page.index('<table class="matrix">') : page.index("What changed, and when")]
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


def test_a_verdict_that_hangs_on_one_flight_says_on_which(page: str) -> None:
    verdicts = told(page[page.index("<h2>What verdicts hang on") : page.index("<h2>How the figures are spread")])
    assert "&lt;odd&gt; 1 IMU: samples a second" in verdicts
    assert "IMU: samples a second fail pass 24 1 0 &lt;odd&gt;" in verdicts


def test_the_page_needs_no_network(page: str) -> None:
    assert all(one.startswith("report/flights/") for one in re.findall(r'href="([^"]*)"', page))
    sources = re.findall(r'src="([^"]{0,26})', page)
    # the trends, histograms of the figure that fails, and of those that pass
    assert [one.partition(";")[0] for one in sources] == ["data:image/png", *["data:image/svg+xml"] * 2]
    assert "<odd>" not in page
    assert not re.search(r">[^<]*\b(nan|None)\b", page)


def test_no_flights_and_one_flight_are_pages(tmp_path: Path) -> None:
    empty = told(made_page(tmp_path / "none", [], {}))
    assert "No cause of trouble shows on 0 flights" in empty
    one = told(made_page(tmp_path / "one", [row("only", "gnss.eph", 1.0)], {"only": []}))
    assert "No cause of trouble shows on 1 flight" in one
    assert "No figure of a vehicle changed over time beyond chance." in one


def test_figures_far_off_without_a_cause_are_no_green_answer(tmp_path: Path) -> None:
    page = made_page(tmp_path, [row("only", "gnss.eph", 9.0, severity="fail", threshold=3.0)], {"only": []})
    assert 'class="decision is-warning"' in page
    assert "1 of 1 flight have figures far beyond their limits" in told(page)


def test_refused_logs_are_told_and_make_no_green_answer(tmp_path: Path) -> None:
    rows = [row(name, "gnss.eph", 1.0, threshold=3.0) for name in ("slow", "x")]
    diagnoses = {
        "slow": made_diagnosis("slow", [], "the IMU is logged at 20 Hz"),
        "x": made_diagnosis("x", [], "the log is empty", readable=False),
    }
    page = told(made_page(tmp_path, rows, diagnoses))
    assert "No cause of trouble shows on 0 of 2 flights; the others cannot be replayed" in page
    assert "1 log without a diagnosis, unreadable or too damaged: x." in page
    assert "1 log that cannot be replayed, so less can be told: slow." in page
    assert page.count("(refused)") == 2
