"""The study of decision rules, on a small size: one command flies, replays, decides and judges."""

from __future__ import annotations

import sys
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


@pytest.fixture(scope="module")
def worlds(tmp_path_factory: pytest.TempPathFactory, project_root: Path):
    """Two worlds of three flights with four sets each, on the first lane of the survey mission."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(project_root)
        patch.syspath_prepend(project_root)
        from benchmarks.decision_study.collect import StudyFiles, collect
        from benchmarks.decision_study.world import read_world

        root = tmp_path_factory.mktemp("decision_study")
        study = {
            "name": "small",
            "kind": "list",
            "sets": [{"name": name, "parameters": values} for name, values in SETS.items()],
        }
        (root / "sets.yaml").write_text(yaml.safe_dump(study))
        everything = yaml.safe_load(Path("benchmarks/decision_study/worlds.yaml").read_text())
        chosen = {name: everything[name] for name in ("calm", "vibrating")}
        (root / "worlds.yaml").write_text(yaml.safe_dump(chosen))
        mission = yaml.safe_load(Path("config/missions/survey.yaml").read_text())
        (root / "lane.yaml").write_text(yaml.safe_dump(mission | {"waypoints": mission["waypoints"][:3]}))
        files = StudyFiles(root / "worlds.yaml", root / "sets.yaml", root / "lane.yaml")
        folders = collect(files, 3, root / "flights", 1)
        settings = DecisionSettings(draws=500)
        yield {name: read_world(name, paths, files.overrides(), settings) for name, paths in folders.items()}
    sys.modules.pop("benchmarks", None)


def judged(world, rule: str):
    from benchmarks.decision_study.judge import judge
    from benchmarks.decision_study.rules import rules

    everything = range(len(world.sets))
    chosen = rules(DecisionSettings(draws=500))[rule](world, range(len(world.flights)), everything)
    return judge(world, "both", everything, rule, chosen)


def test_minimum_mean_nis_takes_the_most_inflated_noise(worlds) -> None:
    # Mean NIS falls with every factor on R, whatever the truth is (method, section 2).
    for world in worlds.values():
        assert judged(world, "minimum mean NIS").chosen == "gnss_x4"
        assert max(judged(world, "minimum mean NIS").regret.values()) > 0.2


def test_the_lowest_score_is_near_the_truth(worlds) -> None:
    from benchmarks.decision_study.rules import SCORE_ONLY

    for world in worlds.values():
        assert judged(world, SCORE_ONLY).passes
    assert judged(worlds["vibrating"], SCORE_ONLY).chosen == "process_x3"


def test_three_flights_prove_nothing(worlds) -> None:
    # Of eight ways to flip the signs of three flights one is the flight as it was: p is at least 1/8.
    for world in worlds.values():
        assert judged(world, "fusetune").chosen == "present"


def test_tables_hold_every_rule_and_study(worlds) -> None:
    from benchmarks.decision_study.judge import by_rule, judge_all
    from benchmarks.decision_study.tables import between_marks, choices_table, rules_table

    verdicts = judge_all(list(worlds.values()), 3, DecisionSettings(draws=300))
    assert len(verdicts) == 2 * 3 * len(by_rule(verdicts))
    assert rules_table(verdicts).count("\n") == len(by_rule(verdicts)) + 1
    assert choices_table(verdicts).count("\n") == 2 * 3 + 1
    assert between_marks("a <!-- x --> old <!-- /x --> b", "x", "new") == "a <!-- x -->\nnew\n<!-- /x --> b"


def test_equal_sets_under_dealt_names_are_not_changed(worlds) -> None:
    from benchmarks.decision_study.judge import false_changes

    shares = false_changes(list(worlds.values()), 3, 5, DecisionSettings(draws=200), np.random.default_rng(0))
    assert shares == {"calm": 0.0, "vibrating": 0.0}
