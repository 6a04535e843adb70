"""What a search tried, as trials."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from tests.apply.search.made_ground import PRESENT, SPACE, MadeGround

from fusetune.apply.search.requests import Ask, values_of
from fusetune.apply.search.rounds import run_searches, searches
from fusetune.apply.search.search_trials import search_trials
from fusetune.apply.trials_file import read_trials, write_trials
from fusetune.design.search_settings import SearchSettings
from fusetune.design.tunable_parameters import DELAY_LIMIT

BEST = {"EKF2_GPS_DELAY": 170.0, "EKF2_GPS_V_NOISE": 0.2, "EKF2_ACC_NOISE": 0.7, "EKF2_MAG_NOISE": 0.05}
WEIGHTS = {"EKF2_GPS_DELAY": 1.0, "EKF2_GPS_V_NOISE": 0.3, "EKF2_ACC_NOISE": 0.3}
FLIGHTS = ["1", "2", "3", "4"]


def made() -> tuple:
    ground = MadeGround(BEST, WEIGHTS, spread=0.05)
    settings = SearchSettings(evaluations=100, folds=2)
    found, asked = run_searches(searches(FLIGHTS, settings), SPACE, settings, ground)
    base = Ask("all", values_of(PRESENT), (values_of(found[0].base),))
    (of_base,) = ground.compare([(FLIGHTS, base)])
    return ground, found[0], asked, search_trials(SPACE, asked, found[0], of_base)


GROUND, FOUND, ASKED, TRIALS = made()


def test_differences_are_those_to_the_present_set_though_the_delay_was_mended_before() -> None:
    assert FOUND.base["EKF2_GPS_DELAY"] != PRESENT["EKF2_GPS_DELAY"]
    scores = [GROUND._score(flight, values_of(PRESENT)) for flight in FLIGHTS]
    for values, differences in zip(TRIALS.values, TRIALS.differences, strict=True):
        tried = values_of(PRESENT | dict(zip(TRIALS.parameters, values.tolist(), strict=True)))
        right = [GROUND._score(flight, tried) - now for flight, now in zip(FLIGHTS, scores, strict=True)]
        assert np.allclose(differences, right, atol=1e-6)


def test_each_set_is_there_once_and_the_found_one_has_its_name() -> None:
    assert len({tuple(row) for row in TRIALS.values.tolist()}) == len(TRIALS.names)
    row = TRIALS.values[TRIALS.names.index("found")]
    assert row.tolist() == [FOUND.values[name] for name in TRIALS.parameters]
    assert not any(name.startswith("delays") for name in TRIALS.names), "the first stage is far from all others"
    assert TRIALS.flights == tuple(FLIGHTS)
    assert DELAY_LIMIT not in TRIALS.parameters


def test_written_and_read_they_are_the_same_to_nine_digits(tmp_path: Path) -> None:
    TRIALS.aims["aided"][0, 1] = np.nan
    write_trials(tmp_path / "trials.json", TRIALS)
    again = read_trials(tmp_path / "trials.json")
    assert again is not None
    assert (again.parameters, again.names, again.flights) == (TRIALS.parameters, TRIALS.names, TRIALS.flights)
    assert np.allclose(again.coordinates, TRIALS.coordinates, atol=1e-7)
    assert np.allclose(again.differences, TRIALS.differences, rtol=1e-8)
    assert np.array_equal(again.allowed, TRIALS.allowed)
    assert np.isnan(again.aims["aided"][0, 1])
    write_trials(tmp_path / "none.json", None)
    assert read_trials(tmp_path / "none.json") is None
