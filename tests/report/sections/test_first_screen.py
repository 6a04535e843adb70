"""The answer: every figure and word of it as the files say."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path
from typing import Any

import pytest
from tests.report.read_page import told

from fusetune.report.results import Results, read_results
from fusetune.report.sections.first_screen import first_screen


@pytest.fixture(scope="module")
def results(made: tuple[Path, str]) -> Results:
    """Of five flights that end in a change from `present` to `better`."""
    root, _ = made
    return read_results([root / "analyze" / f"flight_{i}" for i in range(5)], root / "apply")


def with_decision(results: Results, **changes: Any) -> Results:
    return dataclasses.replace(results, decision=results.decision | changes)


def signed(value: float) -> str:
    return f"{value:+.1f}".replace("-", "−")


def change_of(difference: float) -> str:
    """A difference of the score, in nat, as a change of the error."""
    return signed(100.0 * math.expm1(difference))


def test_a_change_tells_what_to_load_what_it_brings_and_how_sure(results: Results) -> None:
    words = told(first_screen(results))
    chosen = next(one for one in results.decision["ranking"] if one["name"] == "better")
    ends = f"{change_of(chosen['lower'])} to {change_of(chosen['upper'])} %"
    assert words.startswith("unknown vehicle · 5 flights") or "· 5 flights" in words
    assert "Change 1 parameter " in words
    assert (
        f"{change_of(chosen['difference'])} % prediction errors (95 % interval {ends}), smaller on 5 of 5 flights"
        in words
    )
    assert "Load results/apply/best_params.params" in words
    (change,) = results.decision["changes"]
    assert f"{change['name']} {change['previous']:g} → {change['value']:g} {change['unit']}".replace("^2", "²") in words
    left_out = results.decision["leave_one_out"]
    assert "the same set is best whichever flight is left out" in words
    assert f"errors change by {change_of(left_out['difference'])} %" in words
    assert results.decision["next_steps"][0]["text"] in words.replace("&#x27;", "'")


def test_keeping_has_the_same_form_and_names_the_nearest_set(results: Results) -> None:
    kept = with_decision(results, status="keep", chosen="present", changes=[], best_candidate="drifting",
                         on_vehicle={"parameters": [], "refused": []})  # fmt: skip
    words = told(first_screen(kept))
    nearest = next(one for one in results.decision["ranking"] if one["name"] == "drifting")
    change = 100.0 * math.expm1(nearest["difference"])
    size = f"{abs(change):.1f} % {'larger' if change > 0.0 else 'smaller'}"
    assert "Keep what flies now" in words
    assert f"No other set proved better. The nearest, “drifting”: prediction errors {size}" in words
    assert "There is nothing to load" in words
    assert "→" not in words


def test_what_is_exploratory_says_so_and_how_many_flights_it_takes(results: Results) -> None:
    words = told(first_screen(with_decision(results, exploratory=True, flights_scored=2)))
    assert "exploratory" in words
    assert "Not sure: 2 flights cannot speak for the next; it takes at least 5." in words
    assert "Sure:" not in words


def test_what_to_mend_leads_to_its_place_and_what_is_loaded_is_not_told_again(results: Results) -> None:
    def finding(id: str, severity: str, **evidence: Any) -> dict[str, Any]:
        return {"id": id, "severity": severity, "found": f"<{id}> is off (on 2 of 5 flights)", "evidence": evidence}

    findings = [
        finding("diagnosis.vibration", "fail", flights="a, b"),
        finding("sensor_delay_wrong", "warning", parameter="EKF2_GPS_DELAY"),
        finding("diagnosis.noise_claim", "warning", mended_by_parameter=True),
        finding("told_noise_mag", "note"),
    ]
    screen = first_screen(with_decision(results, findings=findings))
    assert '<a href="#cause-vibration">&lt;diagnosis.vibration&gt; is off</a>' in screen
    assert "on 2 of 5 flights" in screen
    assert '<a href="#told-and-shown">' in screen
    assert "noise_claim" not in screen
    assert "told_noise_mag" not in screen
    changes = [results.decision["changes"][0] | {"name": "EKF2_GPS_DELAY"}]
    assert "sensor_delay_wrong" not in first_screen(with_decision(results, findings=findings, changes=changes))
    assert "Mend first" not in first_screen(with_decision(results, findings=[]))


def test_what_the_vehicle_cannot_be_given_is_told_and_names_of_its_release(results: Results) -> None:
    refused = {"parameters": [], "refused": [{"name": "EKF2_X", "reason": "no such <thing>", "remedy": "Update"}]}
    words = told(first_screen(with_decision(results, on_vehicle=refused)))
    assert (
        "There is nothing to load, as this vehicle cannot be given all of it. EKF2_X: no such &lt;thing&gt;. Update."
        in words
    )
    named = {"parameters": [{"name": "EKF2_OLD", "stands_for": ["EKF2_ACC_NOISE"]}], "refused": []}
    assert "in the file EKF2_OLD" in told(first_screen(with_decision(results, on_vehicle=named)))


def test_a_picture_stands_beside_and_the_screen_is_short(results: Results) -> None:
    screen = first_screen(results, "<svg></svg>")
    assert '<div class="answer-figure"><svg></svg></div>' in screen
    assert len(re.findall(r"\w+", told(screen))) < 220
