"""The antenna's place in a search: set where it is measured to be wrong, whatever luck does to the score."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from tests.apply.search.made_ground import MadeGround

from fusetune.analyze.delays.lag import Lag
from fusetune.analyze.delays.velocity_place import VelocityPlace
from fusetune.apply.search.measured_place import measured_values
from fusetune.apply.search.plan import plan_of
from fusetune.apply.search.rounds import run_searches, searches
from fusetune.apply.search.space import Space
from fusetune.apply.search.stages import Found
from fusetune.design.factors import factors_around
from fusetune.design.search_settings import SearchSettings

ARM = ("EKF2_GPS_POS_X", "EKF2_GPS_POS_Y", "EKF2_GPS_POS_Z")
PRESENT = {"EKF2_GPS_DELAY": 110.0, "EKF2_ACC_NOISE": 0.35, **dict.fromkeys(ARM, 0.0)}
SPACE = Space(factors_around(PRESENT, tuple(PRESENT)))
RIGHT = PRESENT | {"EKF2_GPS_DELAY": 40.0, "EKF2_ACC_NOISE": 0.9, "EKF2_GPS_POS_X": -0.3}
SETTINGS = SearchSettings(evaluations=250)
FLIGHTS = [str(number) for number in range(6)]


def told(arm: Sequence[float], error_m: float, delay_s: float = 0.11, error_s: float = 0.002) -> VelocityPlace:
    return VelocityPlace(Lag(delay_s, error_s, 1000, 300), np.array(arm), error_m**2 * np.eye(3))


@dataclass
class ToldGround(MadeGround):
    """The same on flights that tell where the antenna is."""

    place: VelocityPlace | None = None

    @property
    def _place(self) -> VelocityPlace | None:
        return self.place


def searched(place: VelocityPlace | None, weight: float = 1.0, best: dict[str, float] = RIGHT) -> Found:
    weights = {"EKF2_GPS_DELAY": 1.0, "EKF2_ACC_NOISE": 1.0, "EKF2_GPS_POS_X": weight}
    ground = ToldGround(best, weights, space=SPACE, place=place)
    return run_searches(searches(FLIGHTS, SETTINGS), SPACE, SETTINGS, ground)[0][0]


def test_delay_and_axes_are_moved_where_they_are_measured_to_be_wrong_beyond_their_errors() -> None:
    """Six flights with errors of 0.06 m: 0.0245 m, three of which are 0.073 m; of the delay 0.8 ms."""
    places = [told((-0.301, 0.07, 0.0), 0.06, 0.0432)] * 6
    arm, late = {"EKF2_GPS_POS_X": pytest.approx(-0.3)}, {"EKF2_GPS_DELAY": 40.0}
    assert measured_values(SPACE, PRESENT, places) == [arm | late, late, arm]
    assert measured_values(SPACE, PRESENT, [told((0.04, 0.0, 0.0), 1e-3)]) == []
    assert measured_values(SPACE, PRESENT, [told((0.0, 0.0, 0.0), 0.1, 0.0432)]) == [late]
    assert measured_values(SPACE, PRESENT, [told((0.0, 0.0, 0.0), 0.1, 0.0432, 0.05)]) == []
    assert measured_values(SPACE, PRESENT, [None]) == []


def test_a_search_takes_over_what_is_measured_and_finds_the_rest() -> None:
    found = searched(told((-0.3, 0.0, 0.0), 0.02, 0.04))
    assert found.values["EKF2_GPS_POS_X"] == pytest.approx(-0.3)
    assert found.values["EKF2_GPS_DELAY"] == pytest.approx(40.0)
    assert found.values["EKF2_ACC_NOISE"] == pytest.approx(0.9, rel=0.3)
    assert set(found.changed) == {"EKF2_GPS_POS_X", "EKF2_GPS_DELAY", "EKF2_ACC_NOISE"}


def test_what_is_not_measured_is_not_moved_even_if_the_score_is_better_with_it() -> None:
    found = searched(None)
    assert found.values["EKF2_GPS_POS_X"] == 0.0
    assert found.values["EKF2_GPS_DELAY"] == 110.0


def test_an_antenna_that_the_score_speaks_against_is_left_where_it_is_told() -> None:
    found = searched(told((0.4, 0.0, 0.0), 0.02, 0.04))
    assert found.values["EKF2_GPS_POS_X"] == 0.0
    assert found.values["EKF2_GPS_DELAY"] == 40.0


def test_rounds_ask_for_no_more_than_was_planned() -> None:
    ground = ToldGround(RIGHT, {"EKF2_GPS_DELAY": 1.0}, space=SPACE, place=told((-0.3, 0.0, 0.0), 0.02, 0.04))
    _, asked = run_searches(searches(FLIGHTS[:1], SETTINGS), SPACE, SETTINGS, ground)
    planned = plan_of(SPACE, SETTINGS).rounds
    assert [one.ask.stage for one in asked] == [stage for stage, _ in planned]
    assert all(len(one.ask.sets) <= size for one, (_, size) in zip(asked, planned, strict=True))


def test_a_space_of_the_antenna_alone_is_searched_too() -> None:
    space = SPACE.only(ARM)
    ground = ToldGround(RIGHT, {"EKF2_GPS_POS_X": 1.0}, space=space, place=told((-0.3, 0.0, 0.0), 0.02))
    (found, *_), _ = run_searches(searches(FLIGHTS, SETTINGS), space, SETTINGS, ground)
    assert found.changed == ("EKF2_GPS_POS_X",)
