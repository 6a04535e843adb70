"""Runs that are killed, raced and fed with exchanged logs: not a byte of their results may be lost or stale.

Every trial begins with a finished run and exchanges its log for another of the same name and an older time stamp. Then

- kill: a run is killed at a random moment, its jobs live on, and the next run starts at once;
- race: two runs and a dry run start at the same time, while other commands look at the folder;
- exchange: a run goes to its end; in every second trial the log is exchanged again meanwhile, and another run follows.

In the end results/ has to hold, byte by byte, what a run that nothing disturbed makes of that log.

    python benchmarks/hostile_runs.py --trials 20 --seed 1 [kill race exchange]
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[1]
UNSTABLE = {"logs", "benchmarks"}
LONG_AGO_S = 1_600_000_000
TOLD = "another run is at work here"

STUDY = {"name": "one", "kind": "list", "sets": [{"name": "high", "parameters": {"EKF2_ACC_NOISE": 0.9}}]}
MISSION = {
    "name": "hop",
    "home": {"lat": 47.397742, "lon": 8.545594, "alt": 488.0},
    "speed_m_s": 5.0,
    "takeoff": {"altitude_m": 5.0, "climb_speed_m_s": 2.0, "ground_s": 15},
    "waypoints": [{"lat": 47.397942, "lon": 8.545594, "alt": 5.0}],
    "landing": {"mode": "return", "descent_speed_m_s": 1.5, "ground_s": 3},
}
CONFIG = {
    "study": "config/one.yaml",
    "mission": "config/hop.yaml",
    "decision": {"draws": 200},
    "scoring": {"settle_s": 1.0, "block_s": 5.0},
}


@dataclass
class Place:
    """A working folder with one log, which can be exchanged for another."""

    folder: Path
    logs: list[bytes]
    target: str
    flown: int = 0
    faults: list[str] = field(default_factory=list)

    def start(self, *arguments: str) -> subprocess.Popen[str]:
        snakefile = ["--snakefile", str(ROOT / "workflow" / "Snakefile"), "--directory", str(self.folder)]
        return subprocess.Popen(
            [sys.executable, "-m", "snakemake", *snakefile, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def start_to_target(self) -> subprocess.Popen[str]:
        """Start a run."""
        return self.start("--cores", "1", self.target)

    def run(self) -> str:
        """Run to the end; what was printed."""
        run = self.start_to_target()
        printed, _ = run.communicate()
        if run.returncode or not (self.folder / self.target).is_file():
            self.faults.append(f"a run failed:\n{printed}")
        return printed

    def exchange(self) -> None:
        """Put the other log in the place of the present one, with a time stamp of long ago, as `cp -p` or `mv` do."""
        self.flown = 1 - self.flown
        other = self.folder / "other"
        other.write_bytes(self.logs[self.flown])
        os.utime(other, (LONG_AGO_S, LONG_AGO_S))
        os.replace(other, self.folder / "flights" / "flight.ulg")

    def results(self) -> dict[str, str]:
        """Digests of all results that have to be the same in every run."""
        root = self.folder / "results"
        return {
            str(file.relative_to(root)): hashlib.sha256(file.read_bytes()).hexdigest()
            for file in sorted(root.rglob("*"))
            if file.is_file() and not file.name.startswith(".") and file.relative_to(root).parts[0] not in UNSTABLE
        }

    def demand(self, expected: dict[str, str], trial: str) -> None:
        """Note what differs from what should be there."""
        found = self.results()
        differing = [name for name in found.keys() | expected.keys() if found.get(name) != expected.get(name)]
        if differing:
            self.faults.append(f"{trial}: {', '.join(sorted(differing))}")
        made = (self.folder / self.target).read_text(encoding="utf-8")
        if hashlib.sha256(self.logs[self.flown]).hexdigest() not in made:
            self.faults.append(f"{trial}: {self.target} does not name the present log")


def make_place(folder: Path, target: str) -> Place:
    """A working folder; its two logs are the same flight with other noise."""
    sys.path.insert(0, str(ROOT / "src"))
    from fusetune.design.missions.mission import load_mission
    from fusetune.ekf2.compiled.kernel_cache import use_kernel_cache
    from fusetune.execute import simulate
    from fusetune.execute.vehicle import load_vehicle

    use_kernel_cache()
    (folder / "flights").mkdir(parents=True)
    (folder / "config").mkdir()
    for name, document in (("one", STUDY), ("hop", MISSION), ("config", CONFIG)):
        (folder / "config" / f"{name}.yaml").write_text(yaml.safe_dump(document), encoding="utf-8")
    mission, vehicle = load_mission(folder / "config/hop.yaml"), load_vehicle(ROOT / "config/vehicles/quadrotor.yaml")
    logs = []
    for seed in (1, 2):
        simulate(mission, vehicle, {}, seed, {}, folder / "made.ulg")
        logs.append((folder / "made.ulg").read_bytes())
    (folder / "flights" / "broken.ulg").write_bytes(b"this is no ULog")
    return Place(folder, logs, target)


def kill(place: Place, trial: int, chance: random.Random, usual_s: float) -> None:
    """A run is killed, its jobs are not, and the next one starts at once."""
    run = place.start_to_target()
    time.sleep(chance.uniform(0.0, usual_s))
    run.kill()
    # not communicate(): the jobs that live on hold the pipe open
    run.wait()
    place.run()


def race(place: Place, trial: int, chance: random.Random, usual_s: float) -> None:
    """Two runs at once, and others that only look."""
    runs = [place.start_to_target()]
    time.sleep(chance.uniform(0.0, 0.5))
    runs.append(place.start_to_target())
    lookers = [place.start("--dry-run"), place.start("--summary")]
    printed = [run.communicate()[0] for run in runs]
    for looker in lookers:
        looker.communicate()
    ended_well = [run.returncode == 0 for run in runs]
    for well, text in zip(ended_well, printed, strict=True):
        if not well and TOLD not in text:
            place.faults.append(f"race {trial}: a run failed:\n{text}")
    if not any(ended_well):
        place.faults.append(f"race {trial}: no run came to its end")


def exchange(place: Place, trial: int, chance: random.Random, usual_s: float) -> None:
    """A run to its end; in every second trial the log is exchanged on the way, and another run follows."""
    if trial % 2 == 0:
        place.run()
        return
    run = place.start_to_target()
    time.sleep(chance.uniform(0.0, usual_s))
    place.exchange()
    run.communicate()
    place.run()


TRIALS: dict[str, Callable[[Place, int, random.Random, float], None]] = {
    "kill": kill,
    "race": race,
    "exchange": exchange,
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"of {', '.join(TRIALS)}; all by default")
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--target", default="results/apply/decision.json", help="a result that names the checksum")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    unknown = set(options.kinds) - TRIALS.keys()
    if unknown:
        parser.error(f"no such kind: {', '.join(sorted(unknown))}")
    folder = Path(tempfile.mkdtemp(prefix="hostile_runs_"))
    place, expected = make_place(folder, options.target), []
    for _ in place.logs:
        place.exchange()
        begun = time.monotonic()
        place.run()
        usual_s = time.monotonic() - begun
        if place.faults:
            print(*place.faults, sep="\n")
            return 1
        expected.append((place.flown, place.results()))
    reference = dict(expected)
    for kind in options.kinds or TRIALS:
        chance, failed = random.Random(options.seed), 0
        for trial in range(options.trials):
            before = len(place.faults)
            place.exchange()
            TRIALS[kind](place, trial, chance, usual_s)
            place.demand(reference[place.flown], f"{kind} {trial}")
            for fault in place.faults[before:]:
                print(fault, flush=True)
            failed += len(place.faults) > before
        print(f"{kind}: {options.trials} trials, {failed} of them with faults", flush=True)
    if not place.faults:
        shutil.rmtree(folder)
    return 1 if place.faults else 0


if __name__ == "__main__":
    sys.exit(main())
