"""The chance of finding a gain: limits that must hold, and against the rule itself."""

import math

import numpy as np
import pytest
from scipy.stats import nct, t

from fusetune.apply.power.power import FLIGHTS, Power, PowerCurve, _gain_surely, power_curve, power_of
from fusetune.apply.power.spread import Spread
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.statistics.moderated import moderated

SETTINGS = DecisionSettings(seed=1)


def spread(deviation: float, sets: int = 1, flights: int = 8, share: float | None = None) -> Spread:
    """Sets that are clearly worse, all varying as much: they are no rivals, and steady the interval."""
    generator = np.random.default_rng(2)
    differences = 0.1 + deviation * generator.standard_normal((flights, sets))
    return Spread(differences, np.full(sets, math.hypot(0.1, deviation)), np.full(sets, deviation), share)


def test_the_chance_is_that_of_a_noncentral_t() -> None:
    """Found is mean + t s/√n below ln 0.99 at 97.5 %, a noncentral t; with the other sets' spread known as from one
    more flight (moderated), between n − 1 and n + 3 degrees of freedom. The rival is clearly worse, so luck is no
    matter from six flights on."""
    deviation, flights = 0.1, 8
    one = spread(deviation)
    planted = float(one.of_gain(math.log(0.9), 1)[0])
    chance = power_curve(one, 10.0, SETTINGS, draws=1500, numbers=(flights,)).chance[0]
    away = (math.log(0.99) - math.log(0.9)) / planted * math.sqrt(flights)
    low, high = (nct.sf(-nct_bound(freedom), freedom, away) for freedom in (flights - 1, flights + 3))
    assert low - 0.04 <= chance <= high + 0.04


def nct_bound(freedom: int) -> float:
    """Student's quantile of the rule: two-sided at `confidence_of_a_change`."""
    return float(t.ppf(0.5 * (1.0 - SETTINGS.confidence_of_a_change), freedom))


def test_more_flights_larger_gains_and_steadier_sets_are_found_more_often() -> None:
    curves = {gain: power_curve(spread(0.06, 4), gain, SETTINGS) for gain in (5.0, 20.0)}
    for one in curves.values():
        assert one.flights == FLIGHTS
        assert all(a <= b for a, b in zip(one.chance, one.chance[1:], strict=False))
    assert all(a <= b for a, b in zip(curves[5.0].chance, curves[20.0].chance, strict=True))
    steady = power_curve(spread(0.01, 4), 5.0, SETTINGS)
    assert steady.needed is not None
    assert steady.needed < (curves[5.0].needed or 99)


def test_a_gain_that_does_not_matter_is_found_no_more_often_than_the_rule_errs() -> None:
    """0.5 %, where 1 % is the smallest for which a change is made; the upper end errs in 1.25 %."""
    assert max(power_curve(spread(0.06, 4), 0.5, SETTINGS, draws=400, numbers=(5, 8)).chance) <= 0.03


def test_fewest_flights_are_read_off_the_curve() -> None:
    curve = PowerCurve(10.0, 1.0, (4, 8, 16), (0.2, 0.6, 1.0))
    assert curve.needed == 12
    assert PowerCurve(10.0, 1.0, (4, 8), (0.1, 0.7)).needed is None
    assert PowerCurve(10.0, 1.0, (4, 8), (0.9, 1.0)).needed == 4


def test_longer_flights_are_weighed_with_the_short_ones_so_far() -> None:
    """Four flights of one minute, long ones vary by half the variance: 10 k-flights alone do; (4·2 + k)·10 ≤ (4 + k)²
    from k = 10 on: 180 ≤ 196, and 170 > 169 for k = 9."""
    short, long = PowerCurve(10.0, 1.0, (4, 30), (0.0, 0.4)), PowerCurve(10.0, 3.0, (4, 10), (0.0, 0.8))
    power = Power(4, 1.0, 0.75, (short,), (long,), math.sqrt(0.5))
    assert power.more(10.0) == 10
    assert power.next_minutes == 3.0
    enough = PowerCurve(10.0, 1.0, (4, 8), (0.9, 1.0))
    assert Power(4, 5.0, 0.5, (enough,)).more(10.0) == 0


def test_flights_that_are_long_or_of_one_block_are_not_asked_to_be_longer() -> None:
    assert power_of(None, 1.0, SETTINGS) is None
    long, unknown = power_of(spread(0.02, 2, share=0.5), 5.0, SETTINGS), power_of(spread(0.02, 2), 1.0, SETTINGS)
    assert long is not None
    assert unknown is not None
    assert (long.longer, unknown.longer) == ((), ())
    assert long.document()["next_minutes"] == 5.0


@pytest.mark.parametrize("seed", [1, 2])
def test_the_same_seed_gives_the_same_curve(seed: int) -> None:
    settings = DecisionSettings(seed=seed)
    assert power_curve(spread(0.05, 3), 10.0, settings) == power_curve(spread(0.05, 3), 10.0, settings)


def test_all_draws_at_once_are_judged_as_the_rule_judges_each() -> None:
    generator = np.random.default_rng(4)
    planted = -0.1 + 0.05 * generator.standard_normal((50, 6))
    others = 0.05 * generator.standard_normal((50, 6, 5))
    one_by_one = []
    for own, rest in zip(planted, others, strict=True):
        rule = moderated(np.column_stack([own, rest]))[0]
        one_by_one.append(rule.mean + rule.reach(SETTINGS.confidence_of_a_change) < SETTINGS.smallest_gain)
    assert _gain_surely(planted, others, SETTINGS).tolist() == one_by_one
    assert 5 < sum(one_by_one) < 45
