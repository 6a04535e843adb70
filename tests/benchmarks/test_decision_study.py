"""The study of decision rules, on a small size: one command flies, replays, decides and judges."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from fusetune.apply.settings import DecisionSettings

SETS = {
    "process_d10": {"EKF2_ACC_NOISE": 0.035, "EKF2_GYR_NOISE": 0.0015},
    "process_x3": {"EKF2_ACC_NOISE": 1.0, "EKF2_GYR_NOISE": 0.045},
    "gnss_x4": {"EKF2_GPS_V_NOISE": 1.2, "EKF2_GPS_P_NOISE": 2.0},
}
SETTINGS = DecisionSettings(draws=300)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory, project_root: Path, benchmarks: None):
    """Two worlds, one of each simulator, with four sets, on the first lane of the survey mission."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(project_root)
        from benchmarks.decision_study.collect import StudyFiles

        root = tmp_path_factory.mktemp("decision_study")
        study = {
            "name": "small",
            "kind": "list",
            "sets": [{"name": name, "parameters": values} for name, values in SETS.items()],
        }
        (root / "sets.yaml").write_text(yaml.safe_dump(study))
        everything = yaml.safe_load(Path("benchmarks/decision_study/worlds.yaml").read_text())
        chosen = {
            "vibrating": everything["vibrating"],
            "aggressive": {"second": {"kinds": ["aggressive"], "airborne_s": 35}},
        }
        (root / "worlds.yaml").write_text(yaml.safe_dump(chosen))
        mission = yaml.safe_load(Path("config/missions/survey.yaml").read_text())
        (root / "lane.yaml").write_text(yaml.safe_dump(mission | {"waypoints": mission["waypoints"][:3]}))
        yield StudyFiles(root / "worlds.yaml", root / "sets.yaml", root / "lane.yaml")


@pytest.fixture(scope="module")
def flown(files, tmp_path_factory: pytest.TempPathFactory):
    """Folders, and three flights of each world in them."""
    from benchmarks.decision_study.collect import Folders, collect

    root = tmp_path_factory.mktemp("flights")
    folders = Folders(root / "judged", root / "saved", root / "raw")
    return folders, collect(files, 3, folders, 1)


@pytest.fixture(scope="module")
def worlds(files, flown):
    from benchmarks.decision_study.world import read_world

    return {name: read_world(name, paths, files.overrides(), SETTINGS) for name, paths in flown[1].items()}


def judged(world, rule: str):
    from benchmarks.decision_study.judge import judge
    from benchmarks.decision_study.rules import rules

    everything = range(len(world.sets))
    chosen = rules(SETTINGS)[rule](world, range(len(world.flights)), everything)
    return judge(world, "both", everything, rule, chosen)


def test_minimum_mean_nis_takes_the_most_inflated_noise(worlds) -> None:
    # Mean NIS falls with every factor on R, whatever the truth is (method, section 2).
    for world in worlds.values():
        assert judged(world, "minimum mean NIS").chosen == "gnss_x4"
        assert max(judged(world, "minimum mean NIS").regret.values()) > 0.2


def test_the_lowest_score_is_near_the_truth(worlds) -> None:
    # Vibration, scale errors and misaligned axes are more than the default accelerometer noise allows for.
    from benchmarks.decision_study.rules import SCORE_ONLY

    for world in worlds.values():
        assert judged(world, SCORE_ONLY).passes
        assert judged(world, SCORE_ONLY).chosen == "process_x3"


def test_three_flights_prove_nothing_to_the_old_rule(worlds) -> None:
    # Of eight ways to flip the signs of three flights one is the flight as it was: p is at least 1/8.
    from benchmarks.decision_study.rules import OLD

    for world in worlds.values():
        assert judged(world, OLD).chosen == "present"


def test_flights_are_flown_once_and_analysed_once(files, flown, capsys: pytest.CaptureFixture[str]) -> None:
    from dataclasses import replace

    from benchmarks.decision_study.collect import collect

    folders, jobs = flown
    saved = folders.saved / "aggressive" / "flight_00" / "metadata.json"
    written = [path.stat().st_mtime_ns for path in sorted(saved.parent.iterdir())]
    capsys.readouterr()
    collect(files, 1, folders, 1, ["aggressive"])
    assert capsys.readouterr().out.strip().endswith(": there")
    # Analysed again elsewhere, from the same saved flight.
    again = replace(folders, judged=folders.judged.with_name("again"), raw=None)
    made = collect(files, 1, again, 1, ["aggressive"])["aggressive"][0]
    assert capsys.readouterr().out.strip().endswith(": scored")
    assert written == [path.stat().st_mtime_ns for path in sorted(saved.parent.iterdir())]
    assert (made / "scoring.json").read_bytes() == (jobs["aggressive"][0] / "scoring.json").read_bytes()


def test_raw_data_hold_estimates_receiver_and_truth(flown) -> None:
    raw = np.load(flown[0].raw / "aggressive" / "flight_00.npz")
    assert raw["sets"].tolist() == ["present", *SETS]
    time = raw["present.time_us"]
    assert np.median(np.diff(time)) == pytest.approx(50_000, abs=5_000)
    truth = [np.interp(time, raw["truth.time_us"], column) for column in raw["truth.velocity"].T]
    flying = (time > 25e6) & (time < 50e6)
    error = raw["present.velocity"][flying] - np.column_stack(truth)[flying]
    # The filter's velocity, wrong by decimetres per second at speeds of several metres per second.
    assert np.sqrt(np.mean(error**2)) < 0.5
    assert raw["gnss.velocity"].shape == (raw["gnss.time_us"].size, 3)


def test_tables_hold_every_rule_and_study(worlds) -> None:
    from benchmarks.decision_study.judge import by_rule, judge_world
    from benchmarks.decision_study.tables import between_marks, choices_table, rules_table, truth_table

    verdicts = [one for world in worlds.values() for one in judge_world(world, 3, SETTINGS)]
    assert len(verdicts) == 2 * 3 * len(by_rule(verdicts))
    assert rules_table(verdicts).count("\n") == len(by_rule(verdicts)) + 1
    assert choices_table(verdicts).count("\n") == 2 * 3 + 1
    assert truth_table(worlds["aggressive"]).count("\n") == len(SETS) + 2
    assert between_marks("a <!-- x --> old <!-- /x --> b", "x", "new") == "a <!-- x -->\nnew\n<!-- /x --> b"
    with pytest.raises(ValueError, match="no place for the table: <!-- y -->"):
        between_marks("a <!-- x --> old <!-- /x --> b", "y", "new")


def test_studies_are_drawn_and_their_power_told(worlds, tmp_path: Path) -> None:
    from benchmarks.decision_study.drawn import draw_studies
    from benchmarks.decision_study.figure import draw_power
    from benchmarks.decision_study.rules import OLD, OURS
    from benchmarks.decision_study.tables import power_table

    drawn = draw_studies(worlds["vibrating"], 2, SETTINGS, np.random.default_rng(0))
    # Of three flights studies of three can be drawn, of three kinds, each judged by two rules.
    assert len(drawn) == 3 * 2 * 2
    assert {one.rule for one in drawn} == {OURS, OLD}
    assert all(one.gained["velocity"] <= one.possible["velocity"] for one in drawn)
    assert "3 flights" in power_table(drawn)
    draw_power(drawn, tmp_path / "power.svg")
    assert (tmp_path / "power.svg").read_text().count("true gain") >= 1


def test_equal_sets_are_not_changed(worlds) -> None:
    from benchmarks.decision_study.nulls import false_changes
    from benchmarks.decision_study.rules import OLD

    shares = false_changes(worlds["vibrating"], 3, 5, SETTINGS, np.random.default_rng(0))
    # See above: three flights prove nothing to the old rule.
    assert {kind: share for (rule, kind), share in shares.items() if rule == OLD} == {
        "equal": 0.0,
        "persistent": 0.0,
        "persistent, skewed": 0.0,
        "nearly equal": 0.0,
        "nearly equal, noisy": 0.0,
    }
