"""Time on the ground is apart from flight time."""

import json
from pathlib import Path

import pandas as pd
import pytest
from tests.analyze.made_flight import END_S, START_US, MadeSet, at, make_flight

from fusetune.analyze.replaying.store.reader import read_set
from fusetune.analyze.scoring.ground_metrics import AFTER_LANDING_US, BEFORE_TAKE_OFF_US, ground_window
from fusetune.analyze.scoring.score_flight import score_saved_flight
from fusetune.analyze.scoring.settings import ScoringSettings
from fusetune.analyze.scoring.window import ScoringWindow


def test_ground_time_is_what_is_left_before_take_off_and_after_landing(tmp_path: Path) -> None:
    _, folder = make_flight(tmp_path, "flight", {"present": MadeSet()})
    flight = ScoringWindow(((at(10.0), at(60.0)),), (), {}, at(3.0))
    log = START_US, at(END_S)
    airborne = [(at(10.0), at(60.0))]
    found = ground_window(read_set(folder, "present"), airborne, log, (), flight, ScoringSettings())
    expected = (at(3.0), at(10.0) - BEFORE_TAKE_OFF_US), (at(60.0) + AFTER_LANDING_US, at(END_S))
    assert found.intervals == expected


def test_resets_and_gaps_are_cut_on_the_ground_as_in_flight(tmp_path: Path) -> None:
    _, folder = make_flight(tmp_path, "flight", {"present": MadeSet(resets_s=(65.0,))})
    flight = ScoringWindow(((at(10.0), at(60.0)),), (), {}, at(10.0))
    gaps = [(at(71.0), at(71.5))]
    found = ground_window(
        read_set(folder, "present"), [(at(10.0), at(60.0))], (START_US, at(END_S)), gaps, flight,
        ScoringSettings(reset_cut_s=2.0),
    )  # fmt: skip
    assert found.intervals == (
        (at(61.0), at(64.5)),
        (at(67.0), at(71.0)),
        (at(73.5), at(END_S)),
    )


def test_a_flight_without_warm_up_has_no_ground_time(tmp_path: Path) -> None:
    _, folder = make_flight(tmp_path, "flight", {"present": MadeSet()})
    never = ScoringWindow((), (), {}, None, "nothing")
    present = read_set(folder, "present")
    assert not ground_window(present, [], (0, 10**9), (), never, ScoringSettings()).intervals


def test_ground_figures_have_names_of_their_own(tmp_path: Path) -> None:
    save, folder = make_flight(
        tmp_path, "flight", {"present": MadeSet(error=0.1, claimed=0.2), "b": MadeSet(error=0.3)}, landing_s=50.0
    )
    score_saved_flight(save, folder, ["present", "b"])
    metrics = pd.read_parquet(folder / "metrics.parquet").set_index(["set", "source", "axis", "metric"])
    # 24 s at 5 Hz after the landing: the relative standard error of an RMS is 1/sqrt(2 · 120).
    assert metrics.loc[("b", "gnss_vel", "x", "ground_rms_innovation"), "value"] == pytest.approx(0.3, rel=0.25)
    assert metrics.loc[("b", "gnss_vel", "x", "ground_rms_innovation"), "n"] == pytest.approx(120, abs=2)
    assert metrics.loc[("present", "gnss_vel", "all", "ground_mean_nis"), "value"] == pytest.approx(0.75, rel=0.4)
    assert metrics.loc[("present", "filter", "all", "ground_resets"), "value"] == 0
    scored = json.loads((folder / "scoring.json").read_text())["scored_s"]
    assert metrics.loc[("b", "gnss_vel", "x", "rms_innovation"), "n"] == pytest.approx(5.0 * scored, abs=2)
