"""The loop closed once, on a simulated vehicle: design, fly, search, apply, fly again with what was found, confirmed.

``make demo-loop`` runs it. The vehicle of ``config/vehicles/mistuned_quadrotor.yaml`` is told three things wrong; its
truth stays, and its second flights load ``best_params.params`` of the first run, as a pilot would. Both runs are the
pipeline's own, in a folder of their own: the second one finds the new flights by their parameters and says whether the
change brought what was predicted. Ends with an error where it is not confirmed.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import yaml

from fusetune.apply.history.entries import read_history
from fusetune.apply.history.judge import CONFIRMED
from fusetune.apply.history.words import history_lines
from fusetune.px4.parameters.params_file import read_params

ROOT = Path(__file__).resolve().parents[1]
MISSION, VEHICLE = Path("config/missions/short_survey.yaml"), Path("config/vehicles/mistuned_quadrotor.yaml")
FLIGHTS_BEFORE, FLIGHTS_AFTER = 5, 5
DAYS = ("2025-06-15", "2025-06-16")
SEARCH: dict[str, Any] = {
    "name": "what_shakes",
    "description": "How much the inertial sensors shake, and how late GNSS is.",
    "kind": "search",
    "search": {
        "parameters": ["EKF2_ACC_NOISE", "EKF2_GYR_NOISE", "EKF2_GPS_DELAY"],
        "evaluations": 60,
        "folds": 2,
    },
}
NEXT: dict[str, Any] = {
    "name": "next",
    "description": "Whether what flies now is best, seen from both sides.",
    "kind": "around_present",
    "parameters": ["EKF2_ACC_NOISE"],
}
"""The study after the change: it starts from what flies then."""
CONFIG = {"mission": str(MISSION), "effects": {"try_measured": False}}
HISTORY = "results/apply/history.json"
MARK = ".closed_loop"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run it; 0 where the change is confirmed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=Path("demo-loop"))
    parser.add_argument("--cores", type=int, default=2)
    options = parser.parse_args(arguments)
    started = time.monotonic()
    folder = prepare(options.folder)
    tell(started, f"designed: {MISSION.name}, a search of {', '.join(SEARCH['search']['parameters'])}")
    fly(folder, "first", FLIGHTS_BEFORE, DAYS[0], options.cores, seed=1)
    tell(started, f"flown: {FLIGHTS_BEFORE} flights with the parameters that the vehicle has")
    # the pages wait for the second run, which draws them all
    configure(folder, SEARCH)
    run_pipeline(folder, options.cores, HISTORY)
    loaded = folder / "results" / "apply" / "best_params.params"
    changes = ", ".join(f"{one.name} {one.value:.6g}" for one in read_params(loaded))
    tell(started, f"searched: to load, {changes or 'nothing'}")
    if not changes:
        return 1
    # what a pilot takes along: the next run writes the file anew
    shutil.copyfile(loaded, folder / loaded.name)
    fly(folder, "second", FLIGHTS_AFTER, DAYS[1], options.cores, seed=101, parameters=folder / loaded.name)
    tell(started, f"applied, and flown again: {FLIGHTS_AFTER} flights")
    configure(folder, NEXT)
    run_pipeline(folder, options.cores)
    tell(started, "what it brought:")
    confirmed = False
    for file in sorted((folder / "results" / "history").glob("*.jsonl")):
        history = read_history(file)
        print(*(f"  {line}" for line in history_lines(history)), sep="\n")
        first = next(one for one in history.decisions if one.is_change)
        outcome = history.outcome_of(first)
        confirmed = outcome is not None and outcome.status == CONFIRMED
    print(f"The page: {folder / 'results' / 'report.html'}")
    return 0 if confirmed else 1


def prepare(folder: Path) -> Path:
    """A fresh folder with its configuration; one of an earlier loop is made anew, any other left alone."""
    folder = folder.resolve()
    if folder.exists() and any(folder.iterdir()):
        if not (folder / MARK).exists():
            raise SystemExit(f"{folder} holds something else. Name a new folder with --folder.")
        shutil.rmtree(folder)
    for part in ("flights", MISSION.parent, VEHICLE.parent):
        (folder / part).mkdir(parents=True, exist_ok=True)
    (folder / MARK).touch()
    for file in (MISSION, VEHICLE):
        shutil.copyfile(ROOT / file, folder / file)
    return folder


def configure(folder: Path, study: dict[str, Any]) -> None:
    """Have the next run ask a study."""
    name = f"config/{study['name']}.yaml"
    for file, document in ((name, study), ("config/config.yaml", CONFIG | {"study": name})):
        (folder / file).write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")


def fly(
    folder: Path, name: str, count: int, day: str, cores: int, *, seed: int, parameters: Path | None = None
) -> None:
    """Simulate flights of a day into the folder of flights, as many at a time as there are cores."""
    command = [
        *(sys.executable, "-m", "fusetune.cli", "simulate", "--mission", str(folder / MISSION)),
        *("--vehicle", str(folder / VEHICLE), "--date", day),
        *(("--parameters", str(parameters)) if parameters is not None else ()),
    ]
    with ThreadPoolExecutor(cores) as pool:
        runs = [
            [*command, "--seed", str(seed + number), "--out", str(folder / "flights" / f"{name}_{number + 1}.ulg")]
            for number in range(count)
        ]
        for done in pool.map(run, runs):
            if done.returncode:
                raise SystemExit(done.stdout)


def run_pipeline(folder: Path, cores: int, *targets: str) -> None:
    """Run Snakemake as a user does, for some files or for all."""
    snakefile = ["--snakefile", str(ROOT / "workflow" / "Snakefile"), "--directory", str(folder)]
    done = run([sys.executable, "-m", "snakemake", "--cores", str(cores), *snakefile, *targets])
    if done.returncode:
        raise SystemExit(done.stdout)


def run(command: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Run a command and keep what it prints."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    return subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, env=environment
    )


def tell(started: float, text: str) -> None:
    """A line with the time since the start."""
    print(f"{time.monotonic() - started:6.0f} s  {text}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
