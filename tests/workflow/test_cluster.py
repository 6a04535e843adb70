"""The workflow where jobs are sent elsewhere: by any command, and by Slurm."""

from __future__ import annotations

import json
import re
import shutil
import signal
import struct
import subprocess
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest
from tests.workflow.conftest import CONFIG, ROOT, STUDY, Workspace, make_workspace

from fusetune.running.cluster_jobs import queued_jobs

DECISION = "results/apply/decision.json"
PATIENCE_S = 300.0
BY_COMMAND = ("--executor", "cluster-generic", "--cluster-generic-submit-cmd", "bash", "--jobs", "1")
BY_SLURM = (
    "--workflow-profile",
    str(ROOT / "workflow" / "profiles" / "slurm"),
    "--slurm-init-seconds-before-status-checks",
    "2",
)
QUICK = {
    "withheld": {"gnss_s": 3.0, "gnss_every_s": 10.0, "baro_s": 0, "mag_s": 0},
    "trust": {"causes": False},
}
"""Settings that spare replays."""


def with_note(log: bytes, note: str) -> bytes:
    """The same flight as another log: one more message, for logs with equal bytes are refused."""
    key = b"char[5] note"
    value = note.encode().ljust(5)
    return log + struct.pack("<HBB", 1 + len(key) + len(value), ord("I"), len(key)) + key + value


def simulated_logs(demonstration: Workspace) -> list[bytes]:
    """The log flown with the set `low`, and the later one flown with `high`."""
    return [log.read_bytes() for log in sorted((demonstration.folder / "results" / "execute").glob("*.ulg"))]


def test_a_changed_present_replays_only_the_present_set_and_jobs_elsewhere_find_it(
    workspace: Workspace, demonstration: Workspace
) -> None:
    workspace.write("config.yaml", CONFIG | QUICK | {"effects": {"try_measured": True}})
    flights, results = workspace.folder / "flights", workspace.folder / "results"
    low, high = simulated_logs(demonstration)
    (flights / "first.ulg").write_bytes(low)
    workspace.run_ok(*BY_COMMAND, DECISION)
    present = json.loads((results / "save" / "present.json").read_text(encoding="utf-8"))
    assert present["flight"] == "first"
    assert present["parameters"] == pytest.approx(STUDY["sets"][0]["parameters"])

    (flights / "second.ulg").write_bytes(high)
    workspace.run_ok("--cores", "2", DECISION)
    present = json.loads((results / "save" / "present.json").read_text(encoding="utf-8"))
    assert present["flight"] == "second"
    replayed = {
        name: (results / "logs" / name).read_text(encoding="utf-8").splitlines()[-1]
        for name in ("tell/first.log", "analyze/first.log")
    }
    assert replayed["tell/first.log"] == "told: delays"
    # by the present set all others are measured; what flew is replayed as it was.
    # Two flights measure what the vehicle is told otherwise: config/vehicles/quadrotor.yaml has less ground effect than
    # PX4's default of 4 m
    assert (
        replayed["analyze/first.log"] == "replayed or scored: present, low, high, ground_effect_mended; up to date: 1"
    )
    decision = json.loads((results / "apply" / "decision.json").read_text(encoding="utf-8"))
    assert "ground_effect_mended" in {one["set"] for one in decision["sets"]}
    assert "effect.ground_effect" in {one["id"] for one in decision["findings"]}
    summary = json.loads((results / "analyze" / "first" / "present.json").read_text(encoding="utf-8"))
    assert summary["overrides"] == present["parameters"]


@pytest.fixture(scope="session")  # so that it is asked for before a demonstration is made
def slurm() -> None:
    """A Slurm that takes jobs; the test is skipped where none answers."""
    if find_spec("snakemake_executor_plugin_slurm") is None:
        pytest.skip("needs Snakemake's executor for Slurm: pip install --require-hashes -r requirements-slurm.lock")
    if shutil.which("sbatch") is None:
        pytest.skip("needs Slurm (sbatch, squeue), which is not installed")
    nodes = subprocess.run(["sinfo", "--noheader", "--format=%T"], capture_output=True, text=True, check=False)
    if nodes.returncode != 0 or not {"idle", "mixed", "allocated"} & set(nodes.stdout.split()):
        said = (nodes.stdout + nodes.stderr).strip().splitlines() or ["nothing"]
        pytest.skip(f"needs a node of Slurm that takes jobs; sinfo says {said[-1]!r}")


def wait_until(true: Callable[[], bool], run: subprocess.Popen[bytes]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not true():
        assert run.poll() is None, "the run ended early"
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.1)


@pytest.mark.slurm
@pytest.mark.usefixtures("slurm")
def test_through_slurm_killed_and_with_a_job_cancelled_all_bytes_are_those_of_a_local_run(
    workspace: Workspace, demonstration: Workspace, tmp_path: Path
) -> None:
    local = make_workspace(tmp_path / "local")
    for folder in (local, workspace):
        folder.write("config.yaml", CONFIG | QUICK)
        low, high = simulated_logs(demonstration)
        for number, log in enumerate((low, high, low)):
            (folder.folder / "flights" / f"flight_{number}.ulg").write_bytes(with_note(log, str(number)))
    state = workspace.folder / ".snakemake"

    with open(tmp_path / "killed.log", "wb") as printed:
        run = subprocess.Popen(workspace.command(*BY_SLURM, DECISION), stdout=printed, stderr=printed)
        wait_until(lambda: len(queued_jobs(state)) >= 3, run)
        run.send_signal(signal.SIGKILL)
        run.wait()
    left = queued_jobs(state)
    assert left

    with open(tmp_path / "cancelled.log", "wb") as printed:
        run = subprocess.Popen(workspace.command(*BY_SLURM, DECISION), stdout=printed, stderr=printed)
        flights = workspace.folder / "results" / "save" / "flights.csv"
        wait_until(lambda: flights.exists() and len(queued_jobs(state)) >= 1, run)
        cancelled = queued_jobs(state)[0].number
        subprocess.run(["scancel", cancelled], check=True)
        assert run.wait(PATIENCE_S) != 0
    told = (tmp_path / "cancelled.log").read_text(encoding="utf-8")
    assert "Slurm still had jobs of an interrupted run" in told
    assert all(job.number in told for job in left)
    # the job of a flight's delays, or of its analysis and drawing
    assert re.search(rf"/{cancelled}\.log \(check log file\(s\) for error details\)", told)

    workspace.run_ok(*BY_SLURM, DECISION)
    assert queued_jobs(state) == []
    local.run_ok("--cores", "2", DECISION)
    ours, expected = workspace.results(), local.results()
    assert ours.keys() == expected.keys()
    assert [name for name in ours if ours[name] != expected[name]] == []
