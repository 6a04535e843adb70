"""`fusetune search`: on simulated flights from end to end, stopped in the middle, and with unusable input."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import pytest
from tests.execute.made_hop import fly_hop

from fusetune.cli import main
from fusetune.storage.documents import read_document

SEARCHED = "EKF2_GPS_V_NOISE"
SETTINGS = f"parameters: [{SEARCHED}]\nfolds: 2\nevaluations: 24\n"
TOO_LARGE = 2.4
"""EKF2_GPS_V_NOISE of the flights, m/s: the simulated receiver's errors are below a tenth of that."""

RESULTS = (
    "best_params.params",
    "rollback.params",
    "search.json",
    "trials.json",
    "sensitivity.json",
    "decision.json",
    "search.html",
)

Captured = pytest.CaptureFixture[str]


class Made:
    """Two flights, and the folders of two searches on them: one is killed, and gone on with in two processes instead of
    one, the other runs in one to its end.

    Attributes
    ----------
    printed : what the second told
    kept_when_killed, was_done : number of files that the first had kept when it was killed, and whether it was done
    """

    def __init__(self, root: Path) -> None:
        self.logs = [fly_hop(root / f"hop_{seed}.ulg", {SEARCHED: TOO_LARGE}, seed) for seed in (1, 2)]
        self.settings = root / "search.yaml"
        self.settings.write_text(SETTINGS)
        self.killed, self.whole = root / "killed", root / "whole"
        command = [sys.executable, "-m", "fusetune.cli", *self.options(self.killed), "--cores", "1"]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, start_new_session=True) as first:
            self.kept_when_killed = _kill_when_kept(first, self.killed, 6)
        self.was_done = (self.killed / "search.json").exists()
        printed = StringIO()
        with redirect_stdout(printed):
            assert main([*self.options(self.killed), "--cores", "2"]) == 0
            printed.truncate(0)
            assert main([*self.options(self.whole), "--cores", "1"]) == 0
        self.printed = printed.getvalue().lstrip("\0")

    def options(self, folder: Path) -> list[str]:
        return ["search", *map(str, self.logs), "--parameters", str(self.settings), "--out", str(folder)]


def _kill_when_kept(running: subprocess.Popen[bytes], folder: Path, files: int) -> int:
    """Kill a search and its processes as soon as it has kept so many files; returns how many it has in the end."""
    while running.poll() is None and len(list(folder.glob("tried/*/*.tried.json"))) < files:
        time.sleep(0.05)
    os.killpg(running.pid, signal.SIGKILL)
    running.wait()
    return len(list(folder.glob("tried/*/*.tried.json")))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    return Made(tmp_path_factory.mktemp("search"))


def test_killed_and_gone_on_with_in_two_processes_it_writes_the_same_bytes_as_in_one(made: Made) -> None:
    kept = len(list(made.whole.glob("tried/*/*.tried.json")))
    assert 6 <= made.kept_when_killed < kept
    assert not made.was_done
    for name in RESULTS:
        assert (made.killed / name).read_bytes() == (made.whole / name).read_bytes(), name


def test_run_again_it_replays_nothing_and_writes_the_same_bytes(made: Made, capsys: Captured) -> None:
    before = {name: (made.whole / name).read_bytes() for name in RESULTS}
    assert main([*made.options(made.whole), "--cores", "1"]) == 0
    assert "replays" not in capsys.readouterr().out
    assert {name: (made.whole / name).read_bytes() for name in RESULTS} == before


def test_the_answer_comes_first_in_few_lines_and_names_the_files(made: Made) -> None:
    told, _, answer = made.printed.partition("\n\n")
    lines = answer.splitlines()
    assert lines[0] == "Keep the parameters that fly now, from 2 flights (exploratory)."
    assert f"{SEARCHED} {TOO_LARGE} →" in answer
    assert len(lines) <= 10
    assert str(made.whole / "best_params.params") in lines[-1]
    # a line for each round at the least while it goes on
    assert sum(line.startswith("round 1 of ") for line in told.splitlines()) >= 1


def test_a_noise_that_is_far_too_large_is_found_and_the_flights_kept_aside_agree(made: Made) -> None:
    found = read_document(made.whole / "search.json")
    assert found["parameters"][SEARCHED]["found"] <= TOO_LARGE / 2.0
    assert found["gain_in_search_percent"] > 0.0
    assert list(found["kept_aside"]) == ["hop_1", "hop_2"]
    assert min(found["kept_aside"].values()) > 0.0
    assert found["status"] == "keep", "two flights show nothing firm"


def test_what_was_tried_tells_what_matters(made: Made) -> None:
    trials = read_document(made.whole / "trials.json")["trials"]
    assert trials["factors"][0]["parameter"] == SEARCHED
    assert "found" in trials["names"]
    assert len(trials["names"]) == len({tuple(one) for one in trials["values"]}), "each set once"
    told = read_document(made.whole / "sensitivity.json")
    assert told["sensitivity"]["parameters"][0]["parameter"] == SEARCHED
    page = (made.whole / "search.html").read_text(encoding="utf-8")
    assert told["sentences"][0].split(" (")[0] in page
    assert page.count('class="chart" role="img"') == 5


def test_of_a_single_flight_nothing_is_kept_aside_and_it_says_so(made: Made, tmp_path: Path, capsys: Captured) -> None:
    folder = tmp_path / "one"
    shutil.copytree(made.whole / "save" / "hop_1", folder / "save" / "hop_1")
    shutil.copy(made.whole / "save" / ".made.json", folder / "save")
    shutil.copytree(made.whole / "tried" / "hop_1", folder / "tried" / "hop_1")
    shutil.copy(made.whole / ".search.json", folder)
    options = ["search", str(made.logs[0]), "--parameters", str(made.settings), "--out", str(folder), "--cores", "1"]
    assert main(options) == 0
    printed = capsys.readouterr().out
    assert "(exploratory)" in printed
    assert "nothing shows how much of that is luck" in printed
    found = read_document(folder / "search.json")
    assert (found["status"], found["kept_aside"], found["expected_gain"]) == ("keep", {}, None)
    assert "EKF2_" not in (folder / "best_params.params").read_text(encoding="utf-8")


@pytest.fixture
def no_log(tmp_path: Path) -> Path:
    log = tmp_path / "none.ulg"
    log.write_bytes(b"this is no ULog")
    return log


def failed(options: list[str], capsys: Captured) -> str:
    """What a search says that ends with a mistake of the user, in one line."""
    assert main(["search", *options]) == 2
    printed = capsys.readouterr().err
    assert len(printed.splitlines()) == 1
    return printed


def test_without_a_log_of_the_vehicle_there_is_nothing_to_search_on(
    no_log: Path, tmp_path: Path, capsys: Captured
) -> None:
    printed = failed([str(no_log), "--out", str(tmp_path / "out"), "--cores", "1"], capsys)
    assert "none of the logs can be replayed" in printed


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("paramters: [EKF2_ACC_NOISE]\n", "paramters"),
        ("parameters: [EKF2_ACC_NOIS]\n", "EKF2_ACC_NOISE"),
        ("parameters: [EKF2_AID_MASK]\n", "EKF2_AID_MASK"),
        ("bounds: {MC_ROLL_P: [1, 2]}\n", "MC_ROLL_P"),
        ("- a list\n", "mapping"),
    ],
)
def test_a_file_of_parameters_with_a_mistake_is_named_before_anything_is_begun(
    text: str, named: str, no_log: Path, tmp_path: Path, capsys: Captured
) -> None:
    settings, out = tmp_path / "mine.yaml", tmp_path / "out"
    settings.write_text(text)
    printed = failed([str(no_log), "--out", str(out), "--parameters", str(settings)], capsys)
    assert str(settings) in printed
    assert named in printed
    assert not out.exists()


def test_fewer_evaluations_than_any_search_takes_are_refused(made: Made, tmp_path: Path, capsys: Captured) -> None:
    assert "24" in failed([str(made.logs[0]), "--out", str(tmp_path / "out"), "--evaluations", "5"], capsys)


def test_a_folder_that_holds_something_else_is_left_alone(no_log: Path, tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "results"
    out.mkdir()
    (out / "decision.json").write_text("{}")
    printed = failed([str(no_log), "--out", str(out)], capsys)
    assert str(out) in printed
    assert "decision.json" in printed
    assert [one.name for one in out.iterdir()] == ["decision.json"]
    assert "is a file" in failed([str(no_log), "--out", str(no_log)], capsys)
