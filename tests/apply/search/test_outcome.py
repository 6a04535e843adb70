"""The rounds of a study's searches, to the last one."""

from __future__ import annotations

import pytest
from tests.apply.search.made_ground import PRESENT, SPACE, MadeGround

from fusetune.apply.search.outcome import outcome_rounds
from fusetune.apply.search.plan import planned_rounds
from fusetune.apply.search.requests import values_of
from fusetune.apply.search.rounds import answered
from fusetune.design.search_settings import SearchSettings

FLIGHTS = ["0", "1", "2"]
BEST = {**PRESENT, "EKF2_ACC_NOISE": 0.8}


@pytest.mark.parametrize("exercised", [tuple(PRESENT), ("EKF2_GPS_V_NOISE", "EKF2_ACC_NOISE")])
def test_the_study_alone_says_how_many_rounds_there_are_at_the_most(exercised: tuple[str, ...]) -> None:
    settings = SearchSettings(parameters=tuple(PRESENT), evaluations=24, folds=2)
    numbers: list[int] = []
    ground = MadeGround(BEST, dict.fromkeys(PRESENT, 1.0))
    answered(outcome_rounds(FLIGHTS, SPACE.only(exercised), settings), ground, numbers.append)
    # without delays none of their stages is needed: 1 + 6, putting back in 3, kept aside
    assert numbers[-1] == (planned_rounds(settings) if exercised == tuple(PRESENT) else 11)
    assert planned_rounds(settings) > 11


def test_in_the_last_round_each_search_is_tried_on_what_it_did_not_see() -> None:
    settings = SearchSettings(evaluations=24, folds=2)
    ground = MadeGround(BEST, dict.fromkeys(PRESENT, 1.0), spread=0.3)
    outcome = answered(outcome_rounds(FLIGHTS, SPACE, settings), ground)
    seen, aside = ground.asked[-5:-2], ground.asked[-2:]
    assert [flights for flights, _ in seen] == [one.flights for one in outcome.studied]
    assert [flights for flights, _ in aside] == [one.aside for one in outcome.studied[1:]]
    assert [ask.sets for _, ask in seen] == [(values_of(one.values),) for one in outcome.found]
    assert [ask.sets for _, ask in aside] == [(values_of(one.values),) for one in outcome.found[1:]]
    assert [*outcome.aside] == FLIGHTS
    assert outcome.without["0"] == outcome.found[1].values
