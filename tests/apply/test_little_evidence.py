"""What is said of almost nothing: where nothing shows a spread, nothing is beyond doubt."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from tests.analyze.made_flight import MadeSet
from tests.apply.statistics.test_bootstrap import evidence
from tests.apply.study import make_study
from tests.apply.test_ranking import analyzed

from fusetune.analyze.scoring.metrics_schema import METRICS_SCHEMA
from fusetune.apply.choice import choose
from fusetune.apply.decide import decide
from fusetune.apply.evidence import AIDED, UNAIDED, AnalyzedFlight, BlockSums, FlightEvidence, flight_evidence
from fusetune.apply.ranking import ELIGIBLE, RankedSet, proved_sets, rank
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.statistics.bootstrap import FEWEST_REDRAWN, expanded_interval, holm, p_value, units_redrawn
from fusetune.apply.statistics.leave_one_out import leave_one_out
from fusetune.apply.wording import paragraph

DRAWS = DecisionSettings(draws=400)


def ranked(rows: list[list[float]], config: DecisionSettings = DRAWS) -> dict[str, RankedSet]:
    """Sets "a" (the present one), "b", … with these scores on flights of one block each."""
    flights = [analyzed(number, row) for number, row in enumerate(rows)]
    return {one.name: one for one in rank("abcdefgh"[: len(rows[0])], "a", flights, {}, config)}


def of_blocks(blocks: int, errors: tuple[float, ...] = (1.0, 1.3)) -> AnalyzedFlight:
    """One flight of some blocks; every set's errors are those of the first times a factor, and noise of its own."""
    one = evidence(1, errors, blocks=blocks)
    (part,) = one.aims
    noise = np.random.default_rng(2).uniform(0.5, 1.5, part.sum_nis.shape)
    one = dataclasses.replace(one, aims=(dataclasses.replace(part, sum_nis=part.sum_nis * noise),))
    summary = {"sets": {name: {"same_results_as_present": False} for name in one.sets}, "scored_s": 10.0 * blocks}
    return AnalyzedFlight(one.flight, Path(), summary, METRICS_SCHEMA.empty_table(), one)


def test_of_one_flight_of_one_block_nothing_is_known() -> None:
    found = {one.name: one for one in rank(["set0", "set1"], "set0", [of_blocks(1)], {}, DRAWS)}
    worse = found["set1"]
    assert worse.difference > 0.2
    assert (worse.lower, worse.upper, worse.p_value, worse.p_holm, worse.p_family) == (None,) * 5
    assert (worse.p_best, found["set0"].p_best, worse.behind_best_error) == (None, None, None)
    assert (worse.aims[AIDED].lower, worse.aims[AIDED].upper, worse.worse_aims) == (None, None, ())
    assert worse.status == ELIGIBLE
    for multiplicity in ("none", "holm", "sign_flips"):
        assert not proved_sets([worse], DecisionSettings(multiplicity=multiplicity))


def test_blocks_of_one_flight_are_few_units_like_flights() -> None:
    """With two blocks Student's distribution has one degree of freedom: its 97.5 % quantile is 12.7."""
    found = {one.name: one for one in rank(["set0", "set1"], "set0", [of_blocks(2)], {}, DRAWS)}["set1"]
    assert found.lower is not None
    assert found.upper is not None
    assert found.lower < 0.0 < found.upper
    assert found.p_value is not None
    assert found.p_value > 0.02
    assert found.p_family is None


def test_two_flights_by_hand() -> None:
    """Mean −0.15, standard error 0.05, 12.706 of them to either side, though both flights are better."""
    found = ranked([[0.0, -0.1], [0.0, -0.2]], DecisionSettings(draws=20_000))["b"]
    assert found.lower == pytest.approx(-0.15 - 12.706 * 0.05, rel=0.02)
    assert found.upper == pytest.approx(-0.15 + 12.706 * 0.05, rel=0.02)
    assert found.p_value == pytest.approx(2.0 * stats.t.sf(3.0, 1), rel=0.02)


@pytest.mark.parametrize("flights", [2, 3, 4])
def test_few_flights_have_students_interval(flights: int) -> None:
    differences = np.random.default_rng(flights).normal(-0.1, 0.05, flights)
    found = ranked([[0.0, one] for one in differences], DecisionSettings(draws=20_000))["b"]
    low, high = stats.t.interval(0.95, flights - 1, differences.mean(), stats.sem(differences))
    scatter = 0.02 * (high - low)
    assert (found.lower, found.upper) == (pytest.approx(low, abs=scatter), pytest.approx(high, abs=scatter))
    assert found.p_value == pytest.approx(stats.ttest_1samp(differences, 0.0).pvalue, rel=0.05)
    assert found.p_best is None


def test_few_flights_are_seldom_called_different_where_nothing_is() -> None:
    """False alarms of a 95 % interval from two and three equal flights: 5 % within three standard deviations."""
    generator = np.random.default_rng(5)
    for flights in (2, 3):
        draws = generator.integers(0, flights, (600, flights))
        alarms = 0
        for _ in range(400):
            differences = generator.standard_normal(flights)
            interval = expanded_interval(differences[draws].mean(axis=1), flights, 0.95)
            assert interval is not None
            alarms += interval.excludes_zero
        assert alarms / 400 <= 0.05 + 3.0 * math.sqrt(0.05 * 0.95 / 400)


@pytest.mark.parametrize("rows", [[[0.0, 0.3]] * 2, [[0.0, -0.3]] * 6])
def test_without_variance_there_is_no_interval_and_nobody_is_out(rows: list[list[float]]) -> None:
    found = ranked(rows)["b"]
    assert (found.lower, found.upper, found.p_value, found.behind_best_error) in ((None,) * 4, (None, None, None, 0.0))
    assert found.aims[AIDED].lower is None
    assert found.is_eligible
    assert found.p_best is None
    assert not proved_sets([found], DecisionSettings(multiplicity="none"))


@pytest.mark.parametrize("flights", [1, 2, 6])
@pytest.mark.parametrize("difference", [0.0, 3e-17, -3e-17, 1e-12])
def test_equal_within_rounding_is_equal(flights: int, difference: float) -> None:
    found = ranked([[1.0 + 0.1 * number, 1.0 + 0.1 * number + difference] for number in range(flights)])["b"]
    assert (found.difference, found.p_value, found.flights_better) == (0.0, 1.0, 0)
    assert (found.lower, found.upper) == (None, None)
    assert found.improvement_percent == 0.0
    assert found.p_best == (0.5 if flights >= FEWEST_REDRAWN else None)


def test_holm_leaves_open_what_is_not_known_and_counts_it() -> None:
    assert holm([0.01, None]) == [0.02, None]
    assert holm([None, None]) == [None, None]


def test_draws_that_are_no_numbers_are_left_out() -> None:
    draws = np.array([np.nan, 1.0, 2.0, np.inf, 3.0, 2.0])
    clean = expanded_interval(np.array([1.0, 2.0, 3.0, 2.0]), 8, 0.95)
    assert expanded_interval(draws, 8, 0.95) == clean
    assert expanded_interval(np.full(4, np.nan), 8, 0.95) is None
    assert p_value(math.nan, np.array([1.0, 2.0]), 8) is None
    assert p_value(1.0, np.full(4, np.nan), 8) is None


def test_a_set_without_a_score_is_not_ranked_first() -> None:
    """Errors of exactly 0, and such that are no number, have no logarithm."""
    nis = np.array([[[4.0]], [[0.0]], [[np.nan]]])
    sums = BlockSums(("a", "b", "c"), (("gnss_vel", "gnss_vel x"),), np.full((1, 1), 4.0), nis, np.zeros_like(nis))
    found = flight_evidence("flight", sums, None, {}, DecisionSettings())
    assert found is not None
    assert found.sets == ("a",)
    assert np.isfinite(found.scores).all()


def test_the_kind_of_prediction_with_fewest_blocks_counts() -> None:
    one = evidence(1, (1.0, 1.2), blocks=4, unaided=True)
    aided, unaided = one.aims
    n = unaided.n.copy()
    n[1:] = 0.0
    one = FlightEvidence(one.flight, one.sets, (aided, dataclasses.replace(unaided, n=n)))
    assert (units_redrawn([one], AIDED), units_redrawn([one], UNAIDED), units_redrawn([one])) == (4, 1, 1)
    assert units_redrawn([one, evidence(2, (1.0, 1.2))], UNAIDED) == 1
    assert units_redrawn([one, one]) == 2


def test_leaving_out_flights_that_all_keep_the_present_set_has_no_interval() -> None:
    found = leave_one_out([of_scores([0.0, 0.1])] * 4, ["b"], "a", 0.95)
    assert found is not None
    assert (found.difference, found.lower, found.upper) == (0.0, None, None)


def of_scores(scores: list[float]) -> FlightEvidence:
    found = analyzed(0, scores).evidence
    assert found is not None
    return found


def test_the_words_of_one_block_name_what_is_not_known() -> None:
    for errors, words in (((1.0, 1.3), "has prediction errors"), ((1.3, 1.0), "had errors")):
        flights = [of_blocks(1, errors)]
        found = rank(["set0", "set1"], "set0", flights, {}, DRAWS)
        only = flights[0].evidence
        assert only is not None
        text = paragraph(choose(found, "set0", [only], {}, DRAWS), found, flights, DRAWS)
        assert words in text
        assert "how far chance could do that is not known" in text
        for absent in ("interval", "beyond doubt", "nan", "None", "p ="):
            assert absent not in text


def test_one_block_in_the_files(tmp_path: Path) -> None:
    sets = {"present": MadeSet(error=0.1), "worse": MadeSet(error=0.2), "better": MadeSet(error=0.05)}
    folders, table = make_study(tmp_path, sets, flights=1, landing_s=21.0)
    assert len(json.loads((folders[0] / "scoring.json").read_text())["block_edges_us"]) == 2
    decide(folders, table, tmp_path / "apply", sets=list(sets))
    decision = json.loads((tmp_path / "apply" / "decision.json").read_text())
    unknown = ("lower", "upper", "p_value", "p_holm", "p_family", "p_best")
    for one in decision["ranking"]:
        if one["name"] != "present":
            assert all(one[name] is None for name in unknown)
            assert one["status"] == "eligible"
            assert all(aim["lower"] is None for aim in one["aims"].values())
    assert decision["status"] == "keep"
    with (tmp_path / "apply" / "ranking.csv").open(encoding="utf-8-sig", newline="") as file:
        rows = {row["set"]: row for row in csv.DictReader(file)}
    assert all(rows["worse"][name] == "" for name in UNKNOWN_IN_THE_SHEET)
    assert "nan" not in (tmp_path / "apply" / "ranking.csv").read_text().lower()


UNKNOWN_IN_THE_SHEET = ("difference_lower_nat", "difference_upper_nat", "p_value", "p_holm", "p_family", "p_best",
                        "aided_lower_nat", "aided_upper_nat")  # fmt: skip

SCORES = st.lists(
    st.lists(st.floats(-1.0, 1.0).map(lambda value: round(value, 3)), min_size=3, max_size=3), min_size=1, max_size=7
)


def about(value: float | None, factor: float = 1.0) -> object:
    return None if value is None else pytest.approx(factor * value, rel=1e-6, abs=1e-9)


def interval(one: RankedSet) -> tuple[float | None, float | None]:
    return one.lower, one.upper


@settings(deadline=None, max_examples=25)
@given(SCORES)
def test_a_copy_of_a_set_changes_nothing_for_the_others(rows: list[list[float]]) -> None:
    alone = ranked(rows)
    copied = ranked([[*row, row[2]] for row in rows])
    for name in "abc":
        assert copied[name].status == alone[name].status
        for figure in ("difference", "lower", "upper", "p_value", "p_family", "aims"):
            assert getattr(copied[name], figure) == getattr(alone[name], figure), figure
    assert interval(copied["d"]) == interval(copied["c"])
    assert copied["d"].p_value == copied["c"].p_value


@settings(deadline=None, max_examples=25)
@given(SCORES, st.floats(0.1, 10.0))
def test_the_size_of_differences_does_not_matter(rows: list[list[float]], factor: float) -> None:
    small = ranked([[value - row[0] for value in row] for row in rows])
    large = ranked([[factor * (value - row[0]) for value in row] for row in rows])
    for name in "bc":
        assert large[name].p_value == about(small[name].p_value)
        assert large[name].p_family == about(small[name].p_family)
        assert large[name].status == small[name].status
        for scaled, plain in zip(interval(large[name]), interval(small[name]), strict=True):
            assert scaled == about(plain, factor)


@settings(deadline=None, max_examples=25)
@given(SCORES, st.randoms(use_true_random=False))
def test_the_order_of_flights_does_not_matter(rows: list[list[float]], random) -> None:
    shuffled = random.sample(rows, len(rows))
    one, other = ranked(rows), ranked(shuffled)
    for name in "bc":
        assert other[name].difference == pytest.approx(one[name].difference, abs=1e-12)
        assert other[name].p_family == about(one[name].p_family)
        assert other[name].flights_better == one[name].flights_better
        assert (other[name].lower is None) == (one[name].lower is None)
        if one[name].lower is not None and other[name].lower is not None:
            # 400 draws: the ends scatter
            width = one[name].upper - one[name].lower
            assert other[name].upper - other[name].lower == pytest.approx(width, rel=0.4)
