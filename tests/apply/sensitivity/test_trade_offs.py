"""Pairs that trade off, with ridges that are known."""

from dataclasses import replace

import pytest
from tests.apply.sensitivity.made_trials import NAMES, drawn, made_trials

from fusetune.apply.sensitivity.sensitivity import sensitivity
from fusetune.apply.sensitivity.wording import trade_off_sentence
from fusetune.design.factors import Factor


def test_where_only_a_ratio_counts() -> None:
    """x² of the difference of two logarithms, and a third factor that stands for itself."""
    flights = [
        lambda at, s=s: s * (at[:, 0] - at[:, 1]) ** 2 + 0.03 * at[:, 2] ** 2 for s in (0.02, 0.025, 0.03, 0.035)
    ]
    (found,) = sensitivity(made_trials(drawn(60, 3), flights)).trade_offs
    assert (found.first, found.second) == NAMES[:2]
    assert found.undone == pytest.approx(1.0, abs=0.05)
    assert found.exponent == pytest.approx(1.0, abs=0.1)
    assert trade_off_sentence(found).startswith(
        "EKF2_GPS_V_NOISE and EKF2_ACC_NOISE trade off: their ratio matters more than each alone. With the first "
        "doubled, the second times 2"
    )


def test_a_ridge_of_another_power() -> None:
    """(x + 2 y)²: along the ridge y goes with x to the power of -1/2."""
    flights = [lambda at, s=s: s * (at[:, 0] + 2.0 * at[:, 1]) ** 2 for s in (0.010, 0.012, 0.014)]
    (found,) = sensitivity(made_trials(drawn(60, 2, reach=1.5), flights)).trade_offs
    assert found.exponent == pytest.approx(-0.5, abs=0.05)


def test_parameters_that_stand_for_themselves_do_not_trade() -> None:
    flights = [lambda at, s=s: s * (at[:, 0] ** 2 + at[:, 1] ** 2) for s in (0.02, 0.025, 0.03)]
    assert sensitivity(made_trials(drawn(60, 2), flights)).trade_offs == ()


def test_a_coupling_on_which_flights_do_not_agree_is_none() -> None:
    flights = [
        lambda at, s=s: 0.03 * (at[:, 0] ** 2 + at[:, 1] ** 2) + s * at[:, 0] * at[:, 1] for s in (0.2, -0.2, 0.05)
    ]
    assert sensitivity(made_trials(drawn(60, 2, reach=1.2), flights)).trade_offs == ()


def test_a_delay_and_a_noise_have_no_power_but_a_slope() -> None:
    """x - y is flat, x in steps of 20 ms and y in doublings: a step of one goes with a step of the other."""
    trials = made_trials(drawn(60, 2), [lambda at, s=s: s * (at[:, 0] - at[:, 1]) ** 2 for s in (0.02, 0.025, 0.03)])
    delay = Factor("EKF2_GPS_DELAY", "linear", 40.0, 160.0, 100.0, 20.0)
    values = trials.values.copy()
    values[:, 0] = 100.0 + 20.0 * trials.coordinates[:, 0]
    (found,) = sensitivity(replace(trials, factors=(delay, trials.factors[1]), values=values)).trade_offs
    assert found.exponent is None
    assert found.slope == pytest.approx(1.0, abs=0.1)
    assert trade_off_sentence(found).endswith("moving the second makes up for 100 % of what moving the first costs.")
