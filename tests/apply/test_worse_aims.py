"""Which kinds of prediction rule a set out; by hand."""

import pytest
from tests.apply.statistics.test_leave_one_out import flight

from fusetune.apply.statistics.mean_difference import MeanDifference
from fusetune.apply.worse_aims import mean_weights, worse_aims

WORSE, BETTER, UNSURE = (
    MeanDifference(0.1, 0.05, 0.15, 8),
    MeanDifference(-0.1, -0.15, -0.05, 8),
    MeanDifference(0.1, -0.05, 0.25, 8),
)


def test_a_kind_of_prediction_with_its_share_of_the_weight_rules_a_set_out() -> None:
    weights = {"aided": 0.5, "unaided": 0.5}
    assert worse_aims({"aided": WORSE, "unaided": BETTER}, weights, BETTER) == ("aided",)
    assert worse_aims({"aided": UNSURE, "unaided": BETTER}, weights, BETTER) == ()


def test_one_that_the_flights_hardly_trust_does_not_stand_against_a_proof() -> None:
    weights = {"aided": 0.15, "unaided": 0.85}
    aims = {"aided": WORSE, "unaided": BETTER}
    assert worse_aims(aims, weights, BETTER) == ()
    # Without a proof it is told as before.
    assert worse_aims(aims, weights, UNSURE) == ("aided",)
    assert worse_aims({"aided": BETTER, "unaided": WORSE}, weights, BETTER) == ("unaided",)


@pytest.mark.parametrize(("weight", "held"), [(0.16, ()), (0.17, ("aided",))])
def test_of_three_kinds_a_sixth_is_half_an_equal_share(weight: float, held: tuple[str, ...]) -> None:
    weights = {"aided": weight, "unaided": 0.5, "smoothed": 0.5 - weight}
    assert worse_aims({"aided": WORSE, "unaided": BETTER}, weights, BETTER) == held


def test_an_interval_that_is_not_known_rules_nothing_out_and_proves_nothing() -> None:
    unknown = MeanDifference(0.3, None, None, 1)
    assert worse_aims({"aided": unknown}, {"aided": 1.0}, unknown) == ()
    assert worse_aims({"aided": WORSE}, {"aided": 0.1, "unaided": 0.9}, MeanDifference(-0.3, None, None, 1)) == (
        "aided",
    )


def test_weights_are_means_over_all_flights() -> None:
    flights = [flight("f", [0.0, 0.1]), flight("g", [0.0, 0.1])]
    (aim,) = (one.name for one in flights[0].aims)
    assert mean_weights(flights) == {aim: pytest.approx(1.0)}
    assert mean_weights([]) == {}
