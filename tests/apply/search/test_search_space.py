"""What may be searched, and with how few sets."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.apply.search.made_ground import PRESENT, SPACE, MadeGround

from fusetune.apply.search.log_search import demand_search_folder, fewest_evaluations, search_space
from fusetune.apply.search.rounds import run_searches, searches
from fusetune.apply.search.settings import SearchSettings
from fusetune.errors import UserError


def test_the_smallest_search_tries_no_more_sets_than_it_is_said_to_need() -> None:
    fewest = fewest_evaluations(SPACE, SearchSettings())
    settings = SearchSettings(evaluations=fewest)
    ground = MadeGround(PRESENT | {"EKF2_GPS_DELAY": 160.0, "EKF2_ACC_NOISE": 0.1}, dict.fromkeys(PRESENT, 0.5))
    _, asked = run_searches(searches(["1"], settings), SPACE, settings, ground)
    assert len({values for one in asked for values in one.ask.sets}) <= fewest
    search_space(PRESENT, tuple(PRESENT), settings)
    with pytest.raises(UserError, match=f"mine.yaml: asks for {fewest - 1} .* Give at least {fewest} "):
        search_space(PRESENT, tuple(PRESENT), SearchSettings(evaluations=fewest - 1), "mine.yaml")


def test_bounds_of_what_is_not_searched_are_no_wish_that_is_passed_over() -> None:
    settings = SearchSettings(bounds={"EKF2_GYR_NOISE": (0.01, 0.02)})
    with pytest.raises(UserError, match=r"mine.yaml: gives bounds of EKF2_GYR_NOISE"):
        search_space(PRESENT, ["EKF2_ACC_NOISE"], settings, "mine.yaml")


def test_a_folder_that_was_marked_is_taken_again_and_a_mark_half_written_is_no_other_file(tmp_path: Path) -> None:
    (tmp_path / "..search.partial.json").touch()
    demand_search_folder(tmp_path)
    (tmp_path / "decision.json").touch()
    demand_search_folder(tmp_path)
