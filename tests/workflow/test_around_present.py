"""A study around what flies now: its sets are known only when the flights are listed."""

from __future__ import annotations

import json

from tests.workflow.conftest import CONFIG, Workspace

NEAR = {"name": "near", "kind": "around_present", "parameters": ["EKF2_ACC_NOISE", "EKF2_GPS_DELAY", "EKF2_EV_DELAY"]}


def made(workspace: Workspace) -> set[str]:
    """The sets that were replayed or scored when the flight was analysed last."""
    told = (workspace.folder / "results/logs/analyze/first.log").read_text(encoding="utf-8").splitlines()[-1]
    return set(told.removeprefix("replayed or scored: ").partition(";")[0].split(", "))


def compared(workspace: Workspace) -> list[str]:
    decision = json.loads((workspace.folder / "results/apply/decision.json").read_text(encoding="utf-8"))
    return [one["set"] for one in decision["sets"]]


def params(workspace: Workspace) -> set[str]:
    return {file.stem for file in (workspace.folder / "results/design/around_present").glob("*.params")}


def test_sets_follow_from_the_flights_and_a_factor_more_makes_its_own(flown: Workspace) -> None:
    flown.write("near.yaml", NEAR)
    flown.write("config.yaml", CONFIG | {"study": "config/near.yaml"})
    targets = ("results/apply/decision.json", "results/design/sets.parquet")
    flown.run_ok("--cores", "2", *targets)
    first = {"acc_noise_down", "acc_noise_up", "gps_delay_down", "gps_delay_up"}  # no vision on board
    assert set(compared(flown)) == {"present", *first}
    assert params(flown) == first
    assert "EKF2_ACC_NOISE" in (flown.folder / "results/design/around_present/acc_noise_up.params").read_text("utf-8")
    assert flown.planned_jobs(*targets) == {}
    assert made(flown) == {"present", "as_flown", *first}

    flown.write("near.yaml", NEAR | {"parameters": [*NEAR["parameters"], "EKF2_BARO_NOISE"]})
    flown.run_ok("--cores", "2", *targets)
    more = {"baro_noise_down", "baro_noise_up"}
    assert set(compared(flown)) == {"present", *first, *more}
    assert params(flown) == first | more
    # the present set, by which all are measured, says one value more
    assert made(flown) == {"present", *first, *more}
    assert flown.planned_jobs(*targets) == {}
