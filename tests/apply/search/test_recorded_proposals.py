"""A search that is gone through again with recorded proposals is the same, and thinks nothing over."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from tests.apply.search.made_ground import PRESENT, SPACE, MadeGround

from fusetune.apply.search.outcome import Outcome, outcome_rounds
from fusetune.apply.search.recorded_proposals import RecordedProposals
from fusetune.apply.search.rounds import answered
from fusetune.apply.search.space import Space
from fusetune.design.search_settings import SearchSettings

FLIGHTS = [str(number) for number in range(4)]
SETTINGS = SearchSettings(evaluations=40, folds=2)
BEST = {**PRESENT, "EKF2_GPS_DELAY": 150.0, "EKF2_ACC_NOISE": 0.8}


def gone_through(proposals: RecordedProposals, space: Space = SPACE) -> tuple[MadeGround, Outcome]:
    ground = MadeGround(BEST, dict.fromkeys(PRESENT, 1.0), spread=0.2, space=space)
    return ground, answered(outcome_rounds(FLIGHTS, space, SETTINGS, proposals), ground)


def refused(*_: Any) -> list[dict[str, float]]:
    raise AssertionError("a proposal was made anew")


def test_recorded_and_fresh_proposals_lead_to_the_same_search() -> None:
    fresh = MadeGround(BEST, dict.fromkeys(PRESENT, 1.0), spread=0.2)
    without_record = answered(outcome_rounds(FLIGHTS, SPACE, SETTINGS), fresh)
    first = RecordedProposals()
    recording, outcome = gone_through(first)
    replayed, again = gone_through(RecordedProposals(first.new, refused))
    assert fresh.asked == recording.asked == replayed.asked
    assert list(without_record.found) == list(outcome.found) == list(again.found)
    # 3 searches, 2 generations of the first stage and 6 of the second; those that see the same propose the same
    assert 8 < len(first.new) <= 3 * 8


def test_a_record_of_another_space_is_not_taken() -> None:
    first = RecordedProposals()
    gone_through(first)
    factors = tuple(replace(one, high=one.high * 0.99) for one in SPACE.factors)
    other = RecordedProposals(first.new)
    gone_through(other, Space(factors))
    assert other.new
