"""Flights after a change are measured by the workflow, and the history outlives what it makes."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from tests.workflow.conftest import STUDY, Workspace

from fusetune.apply.history.entries import DecisionEntry, Gain, history_file, keep_decision, read_history
from fusetune.px4.vehicle_identity import VehicleIdentity
from fusetune.storage.documents import read_document


def test_a_flight_that_flew_an_earlier_change_is_measured_once(demonstration: Workspace, tmp_path: Path) -> None:
    again = Workspace(tmp_path / "work")
    shutil.copytree(demonstration.folder, again.folder)
    results = again.folder / "results"
    (kept,) = (results / "history").iterdir()
    (decision,) = read_history(kept).decisions
    assert kept == history_file(results / "history", decision.vehicle)
    low, high = (one["parameters"] for one in STUDY["sets"])
    assert decision.before["EKF2_ACC_NOISE"] == pytest.approx(high["EKF2_ACC_NOISE"])

    # a year before, the other values were changed to those of the last flight
    vehicle: VehicleIdentity = decision.vehicle
    unknown = Gain(None, None, None, 0, 0.95)
    before = {**decision.before, "EKF2_ACC_NOISE": low["EKF2_ACC_NOISE"]}
    changes = {"EKF2_ACC_NOISE": high["EKF2_ACC_NOISE"]}
    entry = DecisionEntry(
        "", "", vehicle, "fusetune", "change", "high", False, True, "2024-01-01T00:00:00Z", before, changes, unknown,
        (), (), (), {},
    )  # fmt: skip
    assert keep_decision(kept, entry)
    text = kept.read_text(encoding="utf-8")
    assert again.planned_jobs("results/apply/history.json") == {"measure_change": 1, "keep_history": 1}
    again.run_ok("--cores", "1", "results/apply/history.json")
    assert kept.read_text(encoding="utf-8").startswith(text)
    history = read_history(kept)
    outcome = history.outcome_of(history.decisions[-1])
    assert outcome is not None
    assert outcome.names == ["flight_2_high"]
    assert outcome.paired.percent is not None
    told = read_document(results / "apply" / "history.json")["decisions"]
    assert [one["outcome"] is not None for one in told] == [False, True]

    text = kept.read_text(encoding="utf-8")
    again.run_ok("--cores", "1", "--forcerun", "keep_history", "--", "results/apply/history.json")
    again.run_ok("--cores", "1", "--delete-all-output")
    assert not (results / "apply" / "decision.json").exists()
    assert kept.read_text(encoding="utf-8") == text
