"""Searches on a ground whose best set is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.apply.search.made_ground import PRESENT, SPACE, MadeGround

from fusetune.apply.search.plan import DELAYS, plan_of
from fusetune.apply.search.rounds import ON_ALL, run_searches, searches
from fusetune.apply.search.stages import Found
from fusetune.design.search_settings import SearchSettings

FLIGHTS = [str(number) for number in range(8)]
SETTINGS = SearchSettings(evaluations=300, seed=3)
BEST = {"EKF2_GPS_DELAY": 160.0, "EKF2_GPS_V_NOISE": 0.12, "EKF2_ACC_NOISE": 0.9, "EKF2_MAG_NOISE": 0.05}
WEIGHTS = {"EKF2_GPS_DELAY": 1.0, "EKF2_GPS_V_NOISE": 1.0, "EKF2_ACC_NOISE": 1.0}


def searched(ground: MadeGround, settings: SearchSettings = SETTINGS, flights: list[str] = FLIGHTS) -> list[Found]:
    return run_searches(searches(flights, settings), SPACE, settings, ground)[0]


def test_the_best_set_is_found_and_what_does_not_matter_keeps_its_value() -> None:
    found = searched(MadeGround(BEST, WEIGHTS))[0]
    assert found.values["EKF2_GPS_DELAY"] == pytest.approx(160.0, abs=10.0)
    for name in ("EKF2_GPS_V_NOISE", "EKF2_ACC_NOISE"):
        assert abs(math.log(found.values[name] / BEST[name])) < math.log(1.5)
    assert found.values["EKF2_MAG_NOISE"] == pytest.approx(PRESENT["EKF2_MAG_NOISE"])
    assert found.changed == ("EKF2_GPS_DELAY", "EKF2_GPS_V_NOISE", "EKF2_ACC_NOISE")
    # putting the delay back costs ½ w u², with u = 50 ms of the reach of 100
    assert found.costs["EKF2_GPS_DELAY"] == pytest.approx(0.5 * 0.5**2, rel=0.3)


def test_nothing_is_changed_where_the_present_set_is_best() -> None:
    found = searched(MadeGround(PRESENT, dict.fromkeys(PRESENT, 1.0)))
    assert all(not one.changed for one in found)
    assert all(one.values == pytest.approx(PRESENT) for one in found)


def test_a_search_never_sees_the_flights_that_were_kept_aside_from_it() -> None:
    ground = MadeGround(BEST, WEIGHTS, spread=0.3)
    studied = searches(FLIGHTS, SETTINGS)
    assert studied[0].name == ON_ALL
    run_searches(studied, SPACE, SETTINGS, ground)
    for place, (flights, _) in enumerate(ground.asked):
        one = studied[place % len(studied)]
        assert flights == one.flights
        assert not {*flights} & {*one.aside}
    # what it found does not depend on them either: other flights in their place change nothing
    last = studied[-1]
    others = [name if name in last.flights else f"1{name}" for name in FLIGHTS]
    again = run_searches(searches(others, SETTINGS), SPACE, SETTINGS, MadeGround(BEST, WEIGHTS, spread=0.3))[0]
    first = run_searches(studied, SPACE, SETTINGS, MadeGround(BEST, WEIGHTS, spread=0.3))[0]
    assert again[-1] == first[-1]


def test_the_same_answers_lead_to_the_same_search_and_another_seed_to_another() -> None:
    one, other, third = (MadeGround(BEST, WEIGHTS, spread=0.2) for _ in range(3))
    assert searched(one) == searched(other)
    assert one.asked == other.asked
    searched(third, SearchSettings(evaluations=300, seed=4))
    assert third.asked != one.asked


def test_the_rounds_are_those_that_were_planned() -> None:
    ground = MadeGround(BEST, WEIGHTS)
    flights = FLIGHTS[:1]
    _, asked = run_searches(searches(flights, SETTINGS), SPACE, SETTINGS, ground)
    planned = plan_of(SPACE, SETTINGS).rounds
    assert [one.ask.stage for one in asked] == [stage for stage, _ in planned]
    assert all(len(one.ask.sets) <= size for one, (_, size) in zip(asked, planned, strict=True))
    assert [one.ask.stage for one in asked].index("all") == len([one for one in planned if one[0] == DELAYS])


@pytest.mark.parametrize("evaluations", [250, 400, 1000])
def test_all_searches_together_try_as_many_sets_as_are_asked_for(evaluations: int) -> None:
    settings = SearchSettings(evaluations=evaluations)
    plan = plan_of(SPACE, settings)
    own = sum(size for _, size in plan.rounds) - plan.start - plan.rounds[0][1]
    together = plan.rounds[0][1] + plan.start + (settings.folds + 1) * own
    # putting back tries one set more a round than there are parameters, and sizes are whole
    assert 0.85 * evaluations <= together <= evaluations + 3 * (settings.folds + 1)


def test_a_single_flight_keeps_none_aside() -> None:
    assert [one.aside for one in searches(["0"], SETTINGS)] == [()]


def test_a_set_at_the_bound_stays_there() -> None:
    # best ACC_NOISE far beyond PX4's limit of 1.0
    best = {**PRESENT, "EKF2_ACC_NOISE": 0.35 * 8.0}
    found = searched(MadeGround(best, {"EKF2_ACC_NOISE": 1.0}))[0]
    assert found.values["EKF2_ACC_NOISE"] == 1.0
    assert np.isfinite(found.costs["EKF2_ACC_NOISE"])
