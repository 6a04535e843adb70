"""Which set is chosen, from rankings made by hand."""

import math

import pytest
from tests.apply.statistics.test_leave_one_out import flight

from fusetune.apply.choice import Choice, choose, choose_after_mending, parameter_distance
from fusetune.apply.ranking import RankedSet, proved_sets
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.statistics.mean_difference import MeanDifference
from fusetune.apply.wording import _comparison, _for_the_pick


def one(name: str, difference: float, upper: float, p_family: float = 0.01, **changes) -> RankedSet:
    values = {
        "name": name, "is_present": False, "reasons": (), "score": difference, "difference": difference,
        "expected": difference,
        "lower": 2 * difference - upper, "upper": upper, "bound": upper,
        "p_value": 0.01, "p_holm": 0.2, "p_family": p_family, "p_best": 0.5,
        "flights": 6, "flights_better": 6, "equal_to_present": False,
        "improvement_percent": 100.0 * (1.0 - math.exp(difference)), "behind_best": 0.0, "behind_best_error": 0.05,
        "aims": {},
    }  # fmt: skip
    return RankedSet(**(values | changes))


PRESENT = one("a", 0.0, 0.0, is_present=True)
FLIGHTS = [flight(str(number), [0.0, -0.2, -0.1]) for number in range(6)]


def chosen(*candidates: RankedSet, distances: dict[str, float] | None = None, **settings) -> str:
    return choose([PRESENT, *candidates], "a", FLIGHTS, distances or {}, DecisionSettings(**settings)).chosen


def test_the_proved_set_with_the_lowest_score_is_chosen() -> None:
    assert chosen(one("b", -0.2, -0.1), one("c", -0.1, -0.05)) == "b"


def test_that_a_change_helps_is_shown_once_then_the_one_that_predicts_best_is_taken() -> None:
    """c alone is more than the luck of many; b gains twice as much, and its own interval is clear of 0 as well."""
    assert chosen(one("b", -0.2, -0.1, p_family=0.07), one("c", -0.1, -0.05)) == "b"
    assert chosen(one("b", -0.2, -0.1, p_family=0.07), one("c", -0.1, -0.05, p_family=0.06)) == "a"


def test_of_two_that_gain_alike_the_surer_one_is_chosen() -> None:
    assert chosen(one("b", -0.1, -0.02, expected=-0.08), one("c", -0.095, -0.06, expected=-0.09)) == "c"


def test_a_better_score_that_may_be_chance_does_not_stand_before_a_proved_one() -> None:
    assert chosen(one("b", -0.2, 0.01), one("c", -0.1, -0.05)) == "c"
    assert chosen(one("b", -0.2, 0.01), one("c", -0.1, 0.01)) == "a"


def test_a_velocity_that_is_surely_nearer_is_proof_if_the_predictions_agree() -> None:
    def nearer(difference: float, unaided: float, **changes) -> RankedSet:
        aims = {"unaided": MeanDifference(unaided, unaided - 0.1, unaided + 0.1, 6),
                "smoothed": MeanDifference(-0.3, -0.4, -0.2, 6)}  # fmt: skip
        return one("b", difference, 0.05, 0.5, **({"aims": aims, "velocity_bound": -0.2, "p_velocity": 0.01} | changes))

    assert chosen(nearer(-0.1, -0.02)) == "b"
    # not where the drift without GNSS is larger, the whole score hardly smaller, the velocity or luck in doubt
    assert chosen(nearer(-0.1, 0.01)) == "a"
    assert chosen(nearer(-0.009, -0.02)) == "a"
    assert chosen(nearer(-0.1, -0.02, velocity_bound=-0.005)) == "a"
    assert chosen(nearer(-0.1, -0.02, p_velocity=0.06)) == "a"
    assert chosen(nearer(-0.1, -0.02, aims={})) == "a"
    text = _for_the_pick(nearer(-0.1, -0.02), nearer(-0.1, -0.02), DecisionSettings())
    assert "its velocity is 25.9 % nearer to the one that the whole flight" in text


def test_a_gain_that_does_not_matter_is_no_reason_for_a_change() -> None:
    """ln 0.99 is −0.01005: with an upper bound of −0.0101 at least 1 % is gained, with −0.01 less."""
    assert chosen(one("b", -0.02, -0.0101)) == "b"
    assert chosen(one("b", -0.02, -0.01)) == "a"
    assert chosen(one("b", -0.02, -0.01), smallest_gain_percent=0.5) == "b"
    assert chosen(one("b", -0.02, -1e-6), smallest_gain_percent=0.0) == "b"


def test_a_set_that_is_worse_in_one_kind_of_prediction_is_not_eligible() -> None:
    worse = {"aided": MeanDifference(0.02, 0.01, 0.03, 6)}
    assert chosen(one("b", -0.2, -0.1, aims=worse, worse_aims=("aided",)), one("c", -0.1, -0.05)) == "c"


def test_of_two_sets_that_predict_alike_the_nearer_one_is_chosen() -> None:
    near, far = one("c", -0.195, -0.1, behind_best_error=0.02), one("b", -0.2, -0.1)
    # at worst it must be hardly worse as well
    assert chosen(far, one("c", -0.195, -0.05, behind_best_error=0.02), distances={"b": 3.0, "c": 1.0}) == "b"
    assert chosen(far, near, distances={"b": 3.0, "c": 1.0}) == "c"
    # More than a standard error or one percent behind is not alike.
    assert chosen(far, one("c", -0.195, -0.1, behind_best_error=0.004), distances={"b": 3.0, "c": 1.0}) == "b"
    assert chosen(far, one("c", -0.18, -0.1, behind_best_error=0.04), distances={"b": 3.0, "c": 1.0}) == "b"


def test_holm_decides_where_it_is_asked_to() -> None:
    assert chosen(one("b", -0.2, -0.1, p_holm=0.2), multiplicity="holm") == "a"
    assert chosen(one("b", -0.2, -0.1, p_holm=0.02, p_family=0.3), multiplicity="holm") == "b"
    assert proved_sets([one("b", -0.2, -0.1, p_family=0.9)], DecisionSettings(multiplicity="none"))


def test_the_words_say_why_a_better_score_was_passed_over() -> None:
    settings = DecisionSettings()
    luck = _for_the_pick(one("c", -0.1, -0.05), one("b", -0.2, 0.01), settings)
    assert "“b” are 18.1 % smaller, but not beyond chance" in luck
    far = _for_the_pick(one("c", -0.195, -0.05), one("b", -0.2, -0.1), settings)
    assert "further from what flies now" in far


def test_a_proved_delay_is_mended_first_and_the_rest_is_judged_with_it_mended() -> None:
    """The delay is measured: the predictions need not prove it again, only not contradict."""
    mended, tuned = one("delay_mended", -0.05, 0.1, p_family=0.4), one("b+delay_mended", -0.15, 0.02, p_family=0.3)
    ranked = [PRESENT, mended, tuned]
    first = Choice("keep", "a", tuned, None, False, None)
    among = Choice("keep", "delay_mended", tuned, None, False, None)
    found = choose_after_mending(first, ranked, among)
    assert (found.status, found.chosen, found.pick, found.beyond_mending) == ("change", "delay_mended", mended, None)
    better = one("b+delay_mended", -0.1, -0.05)
    among = Choice("change", "b+delay_mended", better, better, False, None)
    found = choose_after_mending(first, ranked, among)
    assert (found.chosen, found.pick, found.beyond_mending) == ("b+delay_mended", tuned, better)
    worse = [PRESENT, one("delay_mended", 0.01, 0.1), tuned]
    assert choose_after_mending(first, worse, among) is first


def test_distance_is_the_size_of_the_logarithms_of_the_ratios() -> None:
    present = {"EKF2_ACC_NOISE": 0.35, "EKF2_GYR_NOISE": 0.015, "EKF2_GPS_CTRL": 0.0}
    assert parameter_distance({"EKF2_ACC_NOISE": 0.35 * math.e**3, "EKF2_GYR_NOISE": 0.015 / math.e**4}, present) == (
        pytest.approx(5.0)
    )
    assert parameter_distance({"EKF2_GPS_CTRL": 7.0, "EKF2_ACC_NOISE": 0.35}, present) == pytest.approx(1.0)


def test_what_one_flight_cannot_show_is_not_called_too_small_a_gain() -> None:
    """Its blocks give an interval of −6 to −4.5 %, and no bound for a change, for which they are too few."""
    best = one("b", -0.053, -0.045, p_family=None, bound=None, flights=1, flights_better=1)
    choice = choose([PRESENT, best], "a", FLIGHTS[:1], {}, DecisionSettings())
    text = _comparison(choice, [PRESENT, best], DecisionSettings())
    assert choice.chosen == "a"
    assert "gain that matters" not in text
    assert "one flight cannot show whether the best of several candidates is only favoured by chance" in text
