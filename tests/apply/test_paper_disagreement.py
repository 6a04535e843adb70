"""Why the paper's rule and the decision part: sentences with figures by hand, and from made studies."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.analyze.made_flight import MadeSet
from tests.apply.study import make_study

from fusetune.apply.decide import decide
from fusetune.apply.paper_disagreement import Disagreement, PaperView, reasons
from fusetune.apply.statistics.mean_difference import MeanDifference

FIRST = PaperView("follower", 0.3, 0.4, {"a": 0.5, "b": 0.6, "c": 0.4}, 0.5, 0, 3)
CHOSEN = PaperView("present", 0.48, 0.36, {"a": 0.6, "b": 0.7, "c": 0.3}, 0.4, 0, 3)
CASE = Disagreement(
    first=FIRST,
    chosen=CHOSEN,
    any_consistent=False,
    aided=MeanDifference(math.log(1.02), math.log(0.98), math.log(1.06), 6),
    unaided=MeanDifference(math.log(1.5), math.log(1.2), math.log(1.8), 6),
    smoothed=None,
    score=MeanDifference(math.log(1.2), math.log(0.95), math.log(1.4), 6),
    position_white_share=0.25,
    objections=(),
    confidence=0.95,
)


def text(case: Disagreement) -> str:
    return " ".join(reasons(case))


def test_it_names_both_sets_and_what_the_paper_sees() -> None:
    said = text(CASE)
    assert "takes “follower”, the decision is “present”" in said
    # hypot(0.3, 0.4) = 0.5 and hypot(0.48, 0.36) = 0.6; 0.5 / 0.6 - 1 = -16.7 %, lower on flights a and b.
    assert "0.5 against 0.6 (−16.7 %; lower on 2 of 3 flights)" in said
    # 0.3² - 0.48² = -0.14 is the larger part of the difference: -37.5 % and +11.1 %.
    assert "mostly by its position and height innovations (−37.5 %; velocity +11.1 %)" in said
    assert "Only 25 % of the GNSS position error is white" in said
    assert "no set passes it" in said
    assert "0.5 times what it should be, below the bounds" in said


def test_it_says_what_the_predictions_are_worth_and_what_may_be_chance() -> None:
    sentences = reasons(CASE)
    aided = next(one for one in sentences if one.startswith("One step ahead"))
    unaided = next(one for one in sentences if one.startswith("After seconds without GNSS"))
    assert "2.0 % larger than those of “present” (95% interval −2.0 % to +6.0 %), which may be chance" in aided
    assert "50.0 % larger than those of “present” (95% interval +20.0 % to +80.0 %)." in unaided
    assert "chance" not in unaided
    assert sentences[-1].startswith("So the flights do not tell the two apart")


def test_a_set_that_may_not_be_chosen_is_said_so_instead_of_the_chance() -> None:
    said = text(replace(CASE, objections=("5 resets, the present set has 0",)))
    assert "“follower” is not eligible: 5 resets, the present set has 0." in said
    assert "tell the two apart" not in said


def test_a_white_position_error_is_no_reproach() -> None:
    assert "white" not in text(replace(CASE, position_white_share=0.9))
    assert "white" not in text(replace(CASE, position_white_share=math.nan))


def test_the_velocity_may_be_what_makes_the_difference() -> None:
    said = text(replace(CASE, first=replace(FIRST, position_rms=0.48, velocity_rms=0.14)))
    assert "mostly by its velocity innovations" in said
    assert "white" not in said


def test_a_smaller_rms_outside_of_the_bounds_is_the_reason() -> None:
    consistent = replace(FIRST, position_rms=0.6, flights_inside=3)
    said = text(replace(CASE, first=consistent, any_consistent=True))
    assert "“present” has the smaller innovations" in said
    assert "inside the paper's χ² bounds on 0 of 3 flights only, that of “follower” on 3 of 3" in said


def test_a_consistent_choice_is_no_question_of_bounds() -> None:
    said = text(replace(CASE, chosen=replace(CHOSEN, flights_inside=2), any_consistent=True))
    assert "bounds" not in said


def test_innovations_that_the_paper_cannot_add_up_are_told() -> None:
    assert "cannot rank it" in text(replace(CASE, chosen=replace(CHOSEN, position_rms=math.nan)))


def paper_mode(root: Path, sets: dict[str, MadeSet]) -> tuple[dict[str, Any], dict[str, Any]]:
    folders, table = make_study(root, sets, 5)
    decide(folders, table, root / "apply", sets=list(sets))
    decision = json.loads((root / "apply" / "decision.json").read_text())
    return decision, decision["paper_mode"]


def test_a_study_in_which_the_smallest_innovations_drift_most(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.1, drift=1.0), "follower": MadeSet(error=0.095, drift=3.0)}
    decision, mode = paper_mode(tmp_path, sets)
    assert (decision["chosen"], mode["first"], mode["agrees"]) == ("present", "follower", False)
    unaided = next(one for one in decision["ranking"] if one["name"] == "follower")["aims"]["unaided"]
    sentence = next(one for one in mode["why"] if one.startswith("After seconds without GNSS"))
    # The same figure and interval as in the ranking.
    change, low, high = (100.0 * math.expm1(unaided[key]) for key in ("difference", "lower", "upper"))
    assert f"{change:.1f} % larger" in sentence
    assert f"{low:+.1f} % to {high:+.1f} %" in sentence
    assert change == pytest.approx(200.0, abs=30.0)
    assert "not eligible: worse than the present set in its unaided predictions" in mode["why"][-1]
    assert "lower on 5 of 5 flights" in " ".join(mode["why"])


def test_both_rules_may_choose_the_same_set(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.13), "better": MadeSet(error=0.1, overrides={"EKF2_ACC_NOISE": 0.2})}
    _, mode = paper_mode(tmp_path, sets)
    assert mode["agrees"]
    assert mode["why"] == ["Both rules choose “better”."]


def test_sets_of_one_result_are_no_disagreement(tmp_path: Path) -> None:
    _, mode = paper_mode(tmp_path, {"present": MadeSet(own=0.0), "a twin": MadeSet(own=0.0)})
    assert mode["first"] == "a twin"
    assert mode["agrees"]
    assert "same results" in mode["why"][0]
