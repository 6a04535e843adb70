"""What may be searched, and with how few sets."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.apply.search.made_ground import PRESENT, SPACE, MadeGround

from fusetune.apply.search.plan import fewest_sets
from fusetune.apply.search.rounds import run_searches, searches
from fusetune.apply.search.search_folder import demand_search_folder
from fusetune.apply.search.search_space import search_space
from fusetune.design.search_settings import SearchSettings
from fusetune.errors import UserError


def test_the_smallest_search_tries_about_as_many_sets_as_it_is_said_to_need() -> None:
    fewest = fewest_sets(SPACE, SearchSettings())
    settings = SearchSettings(evaluations=24)
    ground = MadeGround(PRESENT | {"EKF2_GPS_DELAY": 160.0, "EKF2_ACC_NOISE": 0.1}, dict.fromkeys(PRESENT, 0.5))
    flights = [str(number) for number in range(4)]
    _, asked = run_searches(searches(flights, settings), SPACE, settings, ground)
    tried = {(one.search.name, values) for one in asked for values in one.ask.sets}
    shared = {values for one in asked if one.number in (1, 7) for values in one.ask.sets}
    assert len(tried) - 4 * len(shared) <= 1.1 * fewest


def test_bounds_of_what_is_not_searched_are_no_wish_that_is_passed_over() -> None:
    settings = SearchSettings(bounds={"EKF2_GYR_NOISE": (0.01, 0.02)})
    with pytest.raises(UserError, match=r"mine.yaml: gives bounds of EKF2_GYR_NOISE"):
        search_space(PRESENT, ["EKF2_ACC_NOISE"], settings, "mine.yaml")


def test_a_folder_that_was_marked_is_taken_again_and_a_mark_half_written_is_no_other_file(tmp_path: Path) -> None:
    (tmp_path / "..search.partial.json").touch()
    demand_search_folder(tmp_path)
    (tmp_path / "decision.json").touch()
    demand_search_folder(tmp_path)
