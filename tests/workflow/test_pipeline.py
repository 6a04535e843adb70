"""The workflow from end to end, on a short simulated mission."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import time
import zipfile
from pathlib import Path

from tests.workflow.conftest import ONE_MORE_MESSAGE, STUDY, Workspace

from fusetune.ekf2.compiled.kernel_cache import kernel_cache

SUMMARIES = dict.fromkeys(
    ("list_flights", "join_delays", "join_health", "join_fleet", "join_conformance", "decide", "keep_history",
     "build_report", "all"), 1
)  # fmt: skip
DECISION = "results/apply/decision.json"
PATIENCE_S = 300.0


def replay_times(workspace: Workspace, pattern: str) -> dict[str, int]:
    files = (workspace.folder / "results" / "analyze").glob(pattern)
    return {str(file): file.stat().st_mtime_ns for file in files}


def read_flights(workspace: Workspace) -> dict[str, dict[str, str]]:
    with open(workspace.folder / "results" / "save" / "flights.csv", encoding="utf-8-sig", newline="") as file:
        return {row["flight"]: row for row in csv.DictReader(file)}


def test_an_empty_folder_plans_one_simulated_flight_per_set(workspace: Workspace) -> None:
    planned = workspace.planned_jobs()
    planned.pop("compile_kernels", None)
    of_flights = dict.fromkeys(("simulate_flight", "save_flight", "tell_flight", "flight_page"), 2)
    assert planned == {"design": 1, "mission_map": 1, **of_flights, **SUMMARIES}


def test_the_demonstration_ends_with_parameters_decision_and_report(demonstration: Workspace) -> None:
    results = demonstration.folder / "results"
    for name in ("apply/best_params.params", "apply/rollback.params", "apply/ranking.csv", "design/hop.plan"):
        assert (results / name).stat().st_size > 0
    json.loads((results / "apply" / "decision.json").read_text(encoding="utf-8"))
    page = (results / "report.html").read_text(encoding="utf-8")
    assert "http://" not in page.replace("http://www.w3.org", "")
    flights = read_flights(demonstration)
    assert {row["status"] for row in flights.values()} == {"replayable"}
    assert list(flights) == ["flight_1_low", "flight_2_high"]
    for flight in flights:
        sets = json.loads((results / "analyze" / flight / "scoring.json").read_text(encoding="utf-8"))["sets"]
        assert {name: sets[name]["status"] for name in ("present", "low", "high")} == dict.fromkeys(sets, "scored")


def test_the_present_set_carries_the_values_of_the_newest_flight(demonstration: Workspace) -> None:
    summary = demonstration.folder / "results" / "analyze" / "flight_1_low" / "present.json"
    overrides = json.loads(summary.read_text(encoding="utf-8"))["overrides"]
    flown_last = STUDY["sets"][-1]["parameters"]
    assert overrides.keys() == flown_last.keys()
    for name, value in flown_last.items():
        assert abs(overrides[name] - value) < 1e-6  # a log keeps parameters in single precision


def test_the_report_of_snakemake_tells_of_the_results_by_step(demonstration: Workspace, tmp_path: Path) -> None:
    """Of what was decided, with the files that it was decided with."""
    demonstration.run_ok("--report", str(tmp_path / "report.zip"))
    with zipfile.ZipFile(tmp_path / "report.zip") as file:
        page = file.read("report/report.html").decode()
    decision = json.loads((demonstration.folder / DECISION).read_text(encoding="utf-8"))
    assert json.dumps(decision["paragraphs"][0])[1:-1] in page
    assert "config/small.yaml</tt>" in page
    assert [name for name in ("1 Design", "2 Flights", "3 Decision") if f'"{name}"' not in page] == []
    assert '"verdict": "replayable", "found": "0 warnings"' in page


def test_a_second_run_has_nothing_to_do(demonstration: Workspace) -> None:
    assert demonstration.planned_jobs() == {}


def test_a_file_that_is_no_log_is_listed_with_its_reason_and_stops_nothing(flown: Workspace) -> None:
    flown.run_ok("--cores", "2")
    flights = read_flights(flown)
    assert flights["first"]["status"] == "replayable"
    assert flights["broken"]["status"] == "refused"
    assert flights["broken"]["reason"]
    assert (flown.folder / "results" / "report.html").exists()

    before = replay_times(flown, "first/*.json")
    log = (flown.folder / "flights" / "first.ulg").read_bytes()
    (flown.folder / "flights" / "second.ulg").write_bytes(log + ONE_MORE_MESSAGE)
    # whether the pages of the others have to be made again shows when all flights are listed: it is not so
    of_flight = {"save_flight": 1, "tell_flight": 1, "flight_page": 3}
    assert flown.planned_jobs() == {**of_flight, **SUMMARIES}
    flown.run_ok("--cores", "2", DECISION)
    assert read_flights(flown)["second"]["status"] == "replayable"
    assert replay_times(flown, "first/*.json") == before

    flown.write(
        "small.yaml", STUDY | {"sets": [*STUDY["sets"], {"name": "new", "parameters": {"EKF2_ACC_NOISE": 0.5}}]}
    )
    before = flown.results()
    flown.run_ok("--cores", "2", DECISION)
    for flight in ("first", "second"):
        log = flown.folder / "results" / "logs" / "analyze" / f"{flight}.log"
        assert "replayed or scored: new; up to date: 4" in log.read_text(encoding="utf-8")
        name = f"analyze/{flight}/present.states.parquet"
        assert flown.results()[name] == before[name]
        scoring = json.loads((flown.folder / f"results/analyze/{flight}/scoring.json").read_text(encoding="utf-8"))
        assert list(scoring["sets"]) == ["high", "low", "new", "present"]


def test_only_broken_logs_still_end_with_a_report(workspace: Workspace) -> None:
    (workspace.folder / "flights" / "broken.ulg").write_bytes(b"this is no ULog")
    workspace.run_ok("--cores", "2")
    assert (workspace.folder / "results" / "report.html").exists()
    assert (workspace.folder / "results" / "apply" / "best_params.params").exists()


def test_killed_at_any_moment_the_next_run_completes_to_the_same_results(
    workspace: Workspace, demonstration: Workspace
) -> None:
    for trace in ("execute/*.ulg", "analyze/*/present.states.parquet", "apply/decision.json"):
        kill_when_seen(workspace, trace)
    workspace.run_ok("--cores", "1")
    assert workspace.planned_jobs() == {}
    ours, uninterrupted = workspace.results(), demonstration.results()
    assert ours.keys() == uninterrupted.keys()
    assert [name for name in ours if ours[name] != uninterrupted[name]] == []


def kill_when_seen(workspace: Workspace, trace: str) -> None:
    """Start a run and kill it, as the system would, as soon as a result appears that was not there before."""
    results = workspace.folder / "results"
    seen = set(results.glob(trace))
    with open(workspace.folder / "killed_run.log", "a", encoding="utf-8") as printed:
        run = subprocess.Popen(workspace.command("--cores", "2"), stdout=printed, stderr=printed)
        end = time.monotonic() + PATIENCE_S
        while set(results.glob(trace)) <= seen and run.poll() is None and time.monotonic() < end:
            time.sleep(0.02)
        run.send_signal(signal.SIGKILL)
        run.wait()
    assert set(results.glob(trace)) - seen, Path(printed.name).read_text(encoding="utf-8")


def test_an_old_mark_of_compiled_kernels_keeps_nothing_from_being_made(flown: Workspace) -> None:
    """Snakemake then compiles anew, as after an update of the sources; what needs the kernels has to follow."""
    ready = kernel_cache() / "ready.json"
    os.utime(ready, (1, 1))
    flown.run_ok("--cores", "1", "results/apply/decision.json")
    assert ready.stat().st_mtime > 1
    assert (flown.folder / "results" / "apply" / "decision.json").is_file()
