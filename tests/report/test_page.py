"""The report of a made study: complete, self-contained, of the same bytes every time, and saying what the files say."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pandas as pd
import pytest
from tests.analyze.made_flight import MadeSet
from tests.apply.fleet.made_fleet import found, made_diagnosis
from tests.report.made_report import made_input, make_report
from tests.report.read_page import Page, check_page, told

from fusetune.report.page import build_report
from fusetune.report.results import Results, read_results
from fusetune.storage.documents import write_document

TABS = ["Decision", "Flights", "Parameters", "Health", "Sensors", "Method"]


@pytest.fixture(scope="module")
def page(made: tuple[Path, str]) -> Page:
    return check_page(made[1])


@pytest.fixture(scope="module")
def results(made: tuple[Path, str]) -> Results:
    root, _ = made
    return read_results([root / "analyze" / f"flight_{i}" for i in range(5)], root / "apply")


def rows_of(html: str, id: str) -> list[list[str]]:
    """Cells of the rows of the tables of a section."""
    section = html[html.index(f'id="{id}"') :]
    section = section[: section.index("</section>")]
    return [
        [told(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row, flags=re.S)]
        for row in re.findall(r"<tr>(.*?)</tr>", section, flags=re.S)
    ]


def ranking_rows(html: str) -> dict[str, list[str]]:
    """Rows of the ranking by set; tables of other figures stand after it."""
    found: dict[str, list[str]] = {}
    for row in rows_of(html, "ranking"):
        if len(row) > 8:
            found.setdefault(row[0], row)
    return found


def signed(value: float, digits: int = 1) -> str:
    return f"{value:+.{digits}f}".replace("-", "−")


def test_the_page_keeps_the_rules_and_has_its_tabs(page: Page) -> None:
    assert [one.text for one in page.elements if one.attributes.get("role") == "tab"] == TABS
    assert set(re.findall(r"https?://[^\s\"'<]*", page.source)) <= {"http://www.w3.org/2000/svg"}
    assert not re.search(r"@import|url\(", page.source)


def test_the_page_says_what_was_decided_and_why(made: tuple[Path, str]) -> None:
    words = told(made[1])
    assert "Change 1 parameter" in words
    assert "smaller on 5 of 5 flights" in words
    assert "10 resets that moved the state far (by up to 3 m), the present set has 0" in words
    assert "IMU at 20 Hz" in words
    assert "ab" * 32 in words


def test_the_ranking_on_the_page_is_that_of_the_file(made: tuple[Path, str], results: Results) -> None:
    rows = ranking_rows(made[1])
    table = pd.read_parquet(made[0] / "apply" / "ranking.parquet")
    assert len(table) == 4
    for one in table.to_dict("records"):
        name = str(one["name"]).replace("<", "&lt;").replace(">", "&gt;")
        if one["name"] == "present":
            assert rows[name][1:4] == ["flies now", "–", "–"]
            continue
        assert rows[name][1] == one["status"]
        assert rows[name][2] == signed(100.0 * math.expm1(one["difference"]))
        if math.isfinite(one["lower"]):
            assert rows[name][3] == " to ".join(signed(100.0 * math.expm1(one[end])) for end in ("lower", "upper"))
        assert f"{int(one['flights_better'])} of {int(one['flights'])}" in rows[name]


def test_the_change_on_each_flight_is_that_of_the_file(made: tuple[Path, str]) -> None:
    scores = pd.read_parquet(made[0] / "apply" / "per_flight.parquet").pivot(
        index="flight", columns="set", values="score"
    )
    change = 100.0 * (scores["better"] - scores["present"]).map(math.expm1)
    by_flight = {row[0]: row for row in rows_of(made[1], "each-flight") if row}
    assert by_flight["better"][1:] == [signed(change[f"flight_{i}"]) for i in range(5)]
    # the first table; behind a click are the whole names
    logs = {row[0]: row for row in reversed(rows_of(made[1], "flights")) if row}
    for flight, value in change.items():
        assert signed(value) in logs[str(flight)]


def test_the_truth_and_the_paper_stand_on_the_page_as_the_decision_has_them(
    made: tuple[Path, str], results: Results
) -> None:
    words = told(made[1])
    for sentence in (*results.decision["paragraphs"][:-1], *results.decision["paper_mode"]["why"]):
        assert told(sentence.replace("<", "&lt;").replace(">", "&gt;")) in words
    for step in results.decision["next_steps"]:
        assert step["text"] in words
    for digest in results.decision["provenance"]["configuration_files"].values():
        assert digest in words


def test_names_are_escaped(made: tuple[Path, str]) -> None:
    _, page = made
    assert "<restless>" not in page
    assert "&lt;restless&gt;" in page


def test_the_page_is_of_the_same_bytes_twice(made: tuple[Path, str], tmp_path: Path) -> None:
    root, page = made
    build_report(made_input(root), tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == page


def test_findings_flights_and_hostile_words_are_on_the_page_and_do_nothing(
    made: tuple[Path, str], tmp_path: Path
) -> None:
    """A flight that is named as if it were HTML, and causes that are."""
    root, _ = made
    hostile = '<img src=x onerror="a()">'
    cause = found("vibration", "fail") | {"cause": hostile, "remedy": f"`{hostile}` </script>"}
    diagnoses = {"flight_0": [cause], "flight_1": [cause, found("baro_drift", "note")], "flight_2": []}
    files = []
    for flight, causes in diagnoses.items():
        files.append(tmp_path / flight / "diagnosis.json")
        files[-1].parent.mkdir()
        write_document(files[-1], made_diagnosis(flight, causes))
    pages = [tmp_path / "report" / "flights" / f"flight_{i}.html" for i in range(5)]
    given = made_input(root, diagnoses=files, flight_pages=pages)
    build_report(given, tmp_path / "report.html")
    page = check_page((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert not page.all("img")
    for flight, causes in diagnoses.items():
        assert f"report/flights/{flight}.html" in page.links
        for one in causes:
            assert f"report/flights/{flight}.html#at=cause-{one['id']}" in page.links
    assert page.with_id("cause-vibration").text == hostile


def test_no_flights_still_make_a_page(tmp_path: Path) -> None:
    page = told(make_report(tmp_path, {"present": MadeSet(), "b": MadeSet()}, flights=0))
    assert "no flight could be replayed" in page
    assert "No flight has a say" in page
    assert "What the flights say of the sets" not in page


def test_flights_that_cannot_be_scored_still_make_a_page(tmp_path: Path) -> None:
    page = make_report(tmp_path, {"present": MadeSet(), "b": MadeSet()}, flights=1, landing_s=12.0)
    assert "s of flight remain after the warm-up" in page


def test_of_one_block_the_page_says_what_is_not_known(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.1), "worse": MadeSet(error=0.2), "better": MadeSet(error=0.05)}
    page = make_report(tmp_path, sets, flights=1, landing_s=21.0)
    assert "how far chance could do that is not known" in told(page)
    rows = ranking_rows(page)
    for name in ("worse", "better"):
        assert rows[name][1] == "eligible"
        # interval, p and P(best)
        assert rows[name].count("–") == 3
    assert "beyond doubt" not in told(page).partition("Parameters")[0]


def test_flights_that_are_all_distrusted_have_no_say(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.13), "better": MadeSet(error=0.1)}
    reason = "the replay resets its height 144 times where the vehicle did so 0 times"
    fidelity = {"grade": "D", "trust": {"is_compared": True, "reason": reason}}
    page = make_report(tmp_path, sets, flights=2, fidelity=fidelity)
    words = told(page)
    assert "none of the 2 replayed flights has a say" in words
    assert "could not be scored" not in words
    assert reason in words
    assert "Replayed, not in the decision: 2" in words
    assert "In the decision" not in words


def test_all_sets_ruled_out_are_told_as_such(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.1), "a": MadeSet(resets_s=(40.0, 50.0)), "b": MadeSet(fault_flags=8)}
    page = make_report(tmp_path, sets, flights=3)
    words = told(page)
    assert "No other set was eligible for comparison." in words
    assert "Ruled out, and so not eligible: " in words
    assert [row[1] for row in ranking_rows(page).values()].count("not eligible") == 2


def test_a_set_that_diverged_is_told(tmp_path: Path) -> None:
    page = make_report(tmp_path, {"present": MadeSet(), "b": MadeSet(status="diverged")}, flights=1)
    assert "diverged: the covariance is not finite" in page


def test_a_present_set_that_diverged_leaves_the_flight_unscored(tmp_path: Path) -> None:
    page = make_report(tmp_path, {"present": MadeSet(status="diverged"), "b": MadeSet()}, flights=1)
    assert "the present set: diverged: the covariance is not finite" in page
