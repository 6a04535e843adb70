"""What flights after a change show of it, on made flights of which the gain is known."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from tests.analyze.made_flight import MadeSet, make_flight
from tests.apply.history.test_flights_after import ENTRY

from fusetune.analyze.scoring.score_flight import score_saved_flight
from fusetune.apply.evidence import AnalyzedFlight, read_flights
from fusetune.apply.history.entries import AFTER, BEFORE, EvidenceFlight, Gain
from fusetune.apply.history.judge import CONFIRMED, REFUTED, UNKNOWN, judge_change, unpaired_gain
from fusetune.apply.settings import DecisionSettings
from fusetune.px4.vehicle_identity import VehicleIdentity

SETTINGS = DecisionSettings()


def measured(root: Path, before: float, after: float, flights: int = 4, own: float = 0.3) -> list[AnalyzedFlight]:
    sets = {BEFORE: MadeSet(error=before, own=own), AFTER: MadeSet(error=after, own=own)}
    folders = []
    for number in range(flights):
        saved, folder = make_flight(root, f"flight_{number}", sets, seed=100 + number)
        score_saved_flight(saved, folder, list(sets), present=BEFORE)
        folders.append(folder)
    return read_flights(folders, SETTINGS, BEFORE, BEFORE)


def test_a_gain_is_confirmed_and_held_against_what_was_predicted(tmp_path: Path) -> None:
    flights = measured(tmp_path, before=0.13, after=0.1)
    gain = 100.0 * (1.0 - 0.1 / 0.13)
    found = judge_change(replace(ENTRY, predicted=Gain(22.0, 18.0, 26.0, 6, 0.95)), flights, SETTINGS)
    assert found is not None
    assert (found.status, found.against_prediction) == (CONFIRMED, "as predicted")
    assert found.paired.percent == pytest.approx(gain, abs=3.0)
    assert found.paired.lower is not None
    assert found.paired.upper is not None
    assert found.paired.lower < gain < found.paired.upper
    assert found.names == [f"flight_{number}" for number in range(4)]
    for predicted, said in ((Gain(50.0, 45.0, 55.0, 6, 0.95), "less"), (Gain(5.0, 2.0, 8.0, 6, 0.95), "more")):
        other = judge_change(replace(ENTRY, predicted=predicted), flights, SETTINGS)
        assert other is not None
        assert other.against_prediction == said


def test_a_loss_is_refuted_and_what_chance_could_do_is_not_yet_known(tmp_path: Path) -> None:
    worse = judge_change(ENTRY, measured(tmp_path / "worse", before=0.1, after=0.13), SETTINGS)
    assert worse is not None
    assert worse.status == REFUTED
    same = judge_change(ENTRY, measured(tmp_path / "same", before=0.1, after=0.099, flights=3, own=0.9), SETTINGS)
    assert same is not None
    assert same.status == UNKNOWN
    assert judge_change(ENTRY, [], SETTINGS) is None


def evidence(score: float, weights: dict[str, float]) -> EvidenceFlight:
    return EvidenceFlight("", "", "", {"aided": score, "unaided": 0.5 * score}, weights)


def test_the_unpaired_gain_is_welchs_with_the_same_weights_on_all_flights() -> None:
    first, second = [0.3, 0.1, 0.25, 0.2], [-0.1, 0.05, 0.0]
    weights = ({"aided": 0.5, "unaided": 0.5}, {"aided": 0.5, "unaided": 0.5, "smoothed": 0.0})
    found = unpaired_gain([evidence(x, weights[0]) for x in first], [evidence(x, weights[1]) for x in second], 0.95)
    # equal weights: a flight's score is 0.75 of its first figure
    ours, theirs = 0.75 * np.array(second), 0.75 * np.array(first)
    interval = stats.ttest_ind(ours, theirs, equal_var=False).confidence_interval(0.95)
    difference = ours.mean() - theirs.mean()
    assert found.percent == pytest.approx(100.0 * (1.0 - math.exp(difference)))
    assert found.lower == pytest.approx(100.0 * (1.0 - math.exp(interval.high)))
    assert found.upper == pytest.approx(100.0 * (1.0 - math.exp(interval.low)))
    assert unpaired_gain([], [evidence(1.0, weights[0])], 0.95).percent is None


def test_a_vehicle_keeps_its_history_under_a_name_that_every_system_takes() -> None:
    from fusetune.apply.history.entries import history_file

    file = history_file("h", VehicleIdentity("../x", "a/b:c", "4001"))
    assert file.parent == Path("h")
    assert file.name == "a_b_c-.._x-4001.jsonl"
