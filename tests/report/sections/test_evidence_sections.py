"""What the page says of the evidence, on a made study of which the answer is known, and where something is missing."""

import dataclasses
import re
from html import unescape
from pathlib import Path

import pytest
from tests.analyze.made_flight import MadeSet
from tests.report.made_report import make_report

from fusetune.report.comparison import flight_changes
from fusetune.report.results import Results, read_results
from fusetune.report.sections.evidence_sections import holds_section, paper_section, weights_section, withheld_section
from fusetune.report.sections.ranking_tables import objections_table, ranking_table, sign_table


@pytest.fixture(scope="module")
def results(made: tuple[Path, str]) -> Results:
    root, _ = made
    return read_results([root / "analyze" / f"flight_{i}" for i in range(5)], root / "apply")


def cells(html: str) -> list[list[str]]:
    """Text of the cells of all rows of a table."""
    rows = re.findall(r"<tr>(.*?)</tr>", html, flags=re.S)
    return [
        [unescape(re.sub("<.*?>", "", one)).replace("\xa0", " ") for one in re.findall(r"<t[dh].*?</t[dh]>", row)]
        for row in rows
    ]


def with_decision(results: Results, **changes: object) -> Results:
    return dataclasses.replace(results, decision=results.decision | changes)


def test_each_flight_is_a_column_with_the_change_of_each_set(results: Results) -> None:
    head, *rows = cells(sign_table(results))
    assert head == ["set", *results.flights]
    changes = flight_changes(results)
    assert [row[0] for row in rows] == list(changes.columns)
    for row in rows:
        assert row[1:] == [f"{changes[row[0]][flight]:+.1f}".replace("-", "−") for flight in results.flights]


def test_sets_are_not_eligible_for_a_veto_or_for_one_of_the_two_kinds(results: Results) -> None:
    rows = {row[0]: row[1] for row in cells(objections_table(results))}
    assert "10 resets that moved the state far (by up to 3 m), the present set has 0" in rows["<restless>"]
    assert "after seconds without GNSS its errors are" in rows["drifting"]
    assert "better" not in rows
    status = {row[0]: row[1] for row in cells(ranking_table(results))}
    assert status == {
        "set": "",
        "present": "flies now",
        "better": "eligible",
        "drifting": "not eligible",
        "<restless>": "not eligible",
    }


def test_many_reasons_against_a_set_are_cut_short(results: Results) -> None:
    ranking = [dict(one) for one in results.decision["ranking"]]
    for one in ranking:
        if one["name"] == "<restless>":
            one["reasons"] = [f"reason {i}" for i in range(20)]
    html = objections_table(with_decision(results, ranking=ranking))
    assert "reason 3; and 16 more of this kind" in html
    assert "reason 4" not in html


def test_each_flight_left_out_is_a_row_with_what_the_choice_was_worth_there(results: Results) -> None:
    head, *rows = cells(holds_section(results))
    assert head == ["flight left out", "best set of the others", "change of the error there %"]
    changes = flight_changes(results)["better"]
    assert [row[:2] for row in rows[:-1]] == [[f"flight_{i}", "better"] for i in range(5)]
    assert [row[2] for row in rows[:-1]] == [f"{value:+.1f}".replace("-", "−") for value in changes]
    assert rows[-1][0] == "mean"
    text = holds_section(results)
    assert "the same set is best whichever flight is left out" in text
    assert "on average" in text


def test_a_choice_that_hangs_on_single_flights_is_said_to(results: Results) -> None:
    validated = results.decision["leave_one_out"] | {"stays": 3, "upper": 0.1}
    text = holds_section(with_decision(results, leave_one_out=validated))
    assert "the same without any one of 3 of the 5 flights" in text
    kept = validated | {"chosen": dict.fromkeys(validated["chosen"], "present")}
    assert "no set does better than the present one" in holds_section(with_decision(results, leave_one_out=kept))
    assert holds_section(with_decision(results, leave_one_out=None)) == ""


def test_weights_stand_beside_the_whiteness_that_they_come_from(results: Results) -> None:
    head, *rows = cells(weights_section(results))
    assert head == ["flight", "GNSS velocity, white", "weight aided", "weight unaided", "weight smoothed"]
    for flight, white, aided, unaided, smoothed in rows:
        weights = results.decision["weights"][flight]
        assert aided == f"{100 * weights['aided']:.0f} %"
        assert unaided == f"{100 * weights['unaided']:.0f} %"
        assert smoothed == "0 %"
        # The made errors are white.
        assert float(white.removesuffix(" %")) > 80.0


def test_unknown_whiteness_is_called_unknown(results: Results) -> None:
    known = results.metrics[results.metrics["metric"] != "white_share"]
    html = weights_section(dataclasses.replace(results, metrics=known))
    assert cells(html)[0] == ["flight", "weight aided", "weight unaided", "weight smoothed"]
    assert "takes the mean of the others" in html
    without_one = results.metrics[
        (results.metrics["metric"] != "white_share") | (results.metrics["flight"] != "flight_2")
    ]
    html = weights_section(dataclasses.replace(results, metrics=without_one))
    assert {row[0]: row[1] for row in cells(html)}["flight_2"] == "not known"
    assert "takes the mean of the others" in html


def test_drift_without_the_barometer_is_a_table_of_the_sets(results: Results) -> None:
    head, *rows = cells("<table" + withheld_section(results).split("<table")[-1])
    assert head == ["set", "height after 3 s [m]", "height after 6 s [m]", "height after 9 s [m]", "change %"]
    drift = {row[0]: float(row[3]) for row in rows}
    # Half of the drift of the velocity: 0.65 m and 2.5 m; five flights of six gaps each.
    assert drift["present"] == pytest.approx(0.65, rel=0.3)
    assert drift["drifting"] == pytest.approx(2.5, rel=0.3)
    assert float(rows[0][1]) == pytest.approx(drift["present"] / 3.0, rel=0.02)


def test_paper_mode_tells_why(results: Results) -> None:
    why = ["The paper's rule takes “a”, the decision is “b”.", "Because <of> this."]
    mode = results.decision["paper_mode"] | {"why": why, "agrees": False}
    html = paper_section(with_decision(results, paper_mode=mode))
    assert "It does not agree with the decision." in html
    assert "<li>Because &lt;of&gt; this.</li>" in html
    agreed = with_decision(results, paper_mode=mode | {"agrees": True})
    assert "It agrees with the decision." in paper_section(agreed)
    assert cells(html)[0] == ["set", "aggregate RMS", "NIS inside the χ² bounds", "break rate %"]


def test_without_any_gap_and_with_one_set_there_is_still_a_page(tmp_path: Path) -> None:
    page = make_report(tmp_path, {"present": MadeSet()}, flights=1)
    assert "Does the choice hold?" not in page
    assert "With fewer than three flights that count" in page
