"""A search as jobs: killed in the middle, gone on with, and held against one that runs through in one process."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from tests.workflow.conftest import CONFIG, ROOT, Workspace
from tests.workflow.test_cluster import QUICK, simulated_logs, with_note

from fusetune.analyze.analyze_flight import AnalysisSettings
from fusetune.apply.search.found_sets import read_found_sets, write_found_sets
from fusetune.apply.search.log_search import search_logs
from fusetune.apply.search.plan import planned_rounds
from fusetune.apply.search.round_files import read_round, write_round
from fusetune.apply.search.searched_flights import read_searched_flights
from fusetune.apply.search.searched_so_far import SearchedSoFar
from fusetune.apply.search.tried_round import try_round
from fusetune.configuration import Configuration, read_configuration
from fusetune.design.study import load_study
from fusetune.save import read_present

SEARCH = {"parameters": ["EKF2_GPS_V_NOISE", "EKF2_ACC_NOISE"], "evaluations": 24, "folds": 2}
STUDY = {"name": "small", "kind": "search", "search": SEARCH}
TOLD = "results/search/search.json"


@pytest.fixture
def searched(workspace: Workspace, demonstration: Workspace) -> Workspace:
    """A folder with three flights and a search as its study, not run yet."""
    workspace.write("search.yaml", STUDY)
    workspace.write("config.yaml", CONFIG | QUICK | {"study": "config/search.yaml"})
    low, high = simulated_logs(demonstration)
    for name, log in (("first", low), ("second", high), ("third", with_note(high, "third"))):
        (workspace.folder / "flights" / f"{name}.ulg").write_bytes(log)
    return workspace


def contents(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in sorted(folder.rglob("*.json"))}


def when_made(folder: Path) -> dict[Path, int]:
    return {file: file.stat().st_mtime_ns for file in folder.rglob("*.tried.json")}


def kill_when_something_was_tried(workspace: Workspace) -> None:
    """Kill a run and its jobs, by the group of their processes."""
    command = workspace.command("--cores", "2", TOLD)
    run = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True, cwd=ROOT
    )
    end = time.monotonic() + 300.0
    while not when_made(workspace.folder / "results" / "tried"):
        assert run.poll() is None, "the run ended early"
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()


def replayed(workspace: Workspace, number: int) -> int:
    told = (workspace.folder / f"results/logs/search/try_{number}.log").read_text(encoding="utf-8")
    return int(told.rpartition("replayed: ")[2])


def test_a_killed_search_goes_on_and_leaves_what_one_in_a_single_process_does(
    searched: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kill_when_something_was_tried(searched)
    results = searched.folder / "results"
    left = when_made(results / "tried")
    assert not (results / "search" / "tried" / "1" / "third.json").exists()
    searched.run_ok("--cores", "2", TOLD)
    # round 1 asks for the same few sets on 3 flights, a batch each; what was tried before the kill stands
    sets = len(read_round(results / "search" / "ask_1.json").asks[0][1].sets)
    assert replayed(searched, 1) <= sets * (3 - len(left))
    assert left.items() <= when_made(results / "tried").items()
    assert searched.planned_jobs(TOLD) == {}
    # flight by flight the jobs are others, and so is what those ask for that come after them
    assert searched.planned_jobs(TOLD, "--config", "search_job=flight")["search_try_2"] == 3

    monkeypatch.chdir(searched.folder)
    command = tmp_path / "command"
    settings = read_configuration(["config/config.yaml"])
    search_logs(
        sorted((searched.folder / "flights").glob("*.ulg")),
        command,
        load_study(settings.study).search,
        decision=replace(settings.decision, seed=settings.seed),
        analysis=AnalysisSettings(settings.replay, settings.scoring, settings.trust),
        told=lambda line: None,
    )
    assert (command / "search.json").read_bytes() == (results / "search" / "search.json").read_bytes()
    assert (command / "sensitivity.json").read_bytes() == (results / "apply" / "sensitivity.json").read_bytes()
    assert contents(command / "tried") == contents(results / "tried")

    one_by_one = go_through(results, settings, command / "tried", tmp_path / "rounds")
    made = contents(results / "search")
    assert one_by_one.keys() == made.keys() - {"flights.json", "search.json"}
    assert [name for name in one_by_one if one_by_one[name] != made[name]] == []


def go_through(results: Path, settings: Configuration, kept: Path, folder: Path) -> Mapping[str, bytes]:
    """All rounds of the search, flight by flight, where all was tried before."""
    on = read_searched_flights(results / "search" / "flights.json")
    search, decision = load_study(settings.study).search, replace(settings.decision, seed=settings.seed)
    assert search is not None
    asked: list[Path] = []
    tried: list[Path] = []
    for number in range(1, planned_rounds(search) + 1):
        round_file = folder / f"ask_{number}.json"
        write_round(round_file, SearchedSoFar(on, search, decision, asked, tried).asked_in(number))
        asked.append(round_file)
        for flight in on.flights:
            answer = folder / "tried" / str(number) / f"{flight}.json"
            told = try_round(
                read_round(round_file), {flight: results / "save" / flight}, {flight: answer}, kept, decision,
                AnalysisSettings(settings.replay, settings.scoring), 1,
            )  # fmt: skip
            assert [*told][-1] == "replayed: 0"
            tried.append(answer)
    present = read_present(results / "save" / "present.json").parameters
    found, matters = SearchedSoFar(on, search, decision, asked, tried).found(planned_rounds(search), present)
    matters.write(folder)
    write_found_sets(folder / "found.json", found)
    written = read_found_sets(folder / "found.json")
    assert (written.recommended, written.on_flights) == (found.recommended, found.on_flights)

    # before the third flight was added the others were asked the same to begin with
    fewer = replace(on, flights=on.flights[:2])
    first = SearchedSoFar(fewer, search, decision, (), ()).asked_in(1)
    answers = {flight: folder.parent / f"{flight}.json" for flight in fewer.flights}
    saved = {flight: results / "save" / flight for flight in fewer.flights}
    told = try_round(first, saved, answers, kept, decision, AnalysisSettings(settings.replay, settings.scoring), 1)
    sets = len(first.asks[0][1].sets)
    assert [*told] == [f"first: {sets} sets", f"second: {sets} sets", "replayed: 0"]
    return contents(folder)
