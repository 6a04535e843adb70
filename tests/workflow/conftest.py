"""A working folder with a small configuration, in which the workflow is run as a user runs it."""

from __future__ import annotations

import re
import shutil
import struct
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]

STUDY = {
    "name": "small",
    "kind": "list",
    "sets": [
        {"name": "low", "parameters": {"EKF2_ACC_NOISE": 0.2, "EKF2_GPS_V_NOISE": 0.3}},
        {"name": "high", "parameters": {"EKF2_ACC_NOISE": 0.9, "EKF2_GPS_V_NOISE": 0.3}},
    ],
}

MISSION = {
    "name": "hop",
    "home": {"lat": 47.397742, "lon": 8.545594, "alt": 488.0},
    "speed_m_s": 5.0,
    "takeoff": {"altitude_m": 5.0, "climb_speed_m_s": 2.0, "ground_s": 15},
    "waypoints": [
        {"lat": 47.397942, "lon": 8.545594, "alt": 5.0},
        {"lat": 47.397942, "lon": 8.545794, "alt": 6.0},
    ],
    "landing": {"mode": "return", "descent_speed_m_s": 1.5, "ground_s": 3},
}

CONFIG = {
    "study": "config/small.yaml",
    "mission": "config/hop.yaml",
    "demonstration": {"vehicle": "config/quadrotor.yaml"},
    "decision": {"draws": 200},
    "scoring": {"minimum_scored_s": 5.0, "settle_s": 1.0, "block_s": 5.0},
    # one test asks for these sets
    "effects": {"try_measured": False},
}

_NOTE = b"char[5] notenote2"
ONE_MORE_MESSAGE = struct.pack("<HBB", len(_NOTE) + 1, ord("I"), len("char[5] note")) + _NOTE
"""At the end of a log it makes another log of it; a plain copy would be refused as one."""


@dataclass
class Workspace:
    """A folder in which `snakemake` is run."""

    folder: Path

    def write(self, name: str, document: dict[str, Any]) -> None:
        """Write a configuration file."""
        (self.folder / "config" / name).write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")

    def command(self, *arguments: str) -> list[str]:
        """The command line of a run."""
        snakefile = ["--snakefile", str(ROOT / "workflow" / "Snakefile"), "--directory", str(self.folder)]
        return [sys.executable, "-m", "snakemake", *snakefile, *arguments]

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run Snakemake; what it printed is in `stdout`."""
        return subprocess.run(
            self.command(*arguments), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
        )

    def run_ok(self, *arguments: str) -> str:
        """Run Snakemake and demand that it succeeds; returns what it printed."""
        result = self.run(*arguments)
        assert result.returncode == 0, result.stdout
        return result.stdout

    def planned_jobs(self, *targets: str) -> dict[str, int]:
        """Jobs by rule that a dry run counts; empty where there is nothing to do."""
        printed = self.run_ok("--dry-run", *targets)
        if "Nothing to be done" in printed:
            return {}
        table = re.search(r"^Job stats:\njob +count\n[- ]+\n((?:\w+ +\d+\n)+)", printed, re.MULTILINE)
        assert table, printed
        counts = dict(line.split() for line in table[1].splitlines())
        return {name: int(count) for name, count in counts.items() if name != "total"}

    def results(self) -> dict[str, bytes]:
        """Contents of all results that have to be the same in every run."""
        root = self.folder / "results"
        # the history says when it was written
        unstable = {"logs", "benchmarks", "history"}
        return {
            str(file.relative_to(root)): file.read_bytes()
            for file in sorted(root.rglob("*"))
            if file.is_file() and not file.name.startswith(".") and file.relative_to(root).parts[0] not in unstable
        }


def make_workspace(folder: Path) -> Workspace:
    """A fresh folder with the small configuration and no logs."""
    (folder / "flights").mkdir(parents=True)
    (folder / "config").mkdir()
    workspace = Workspace(folder)
    workspace.write("config.yaml", CONFIG)
    workspace.write("small.yaml", STUDY)
    workspace.write("hop.yaml", MISSION)
    shutil.copy(ROOT / "config" / "vehicles" / "quadrotor.yaml", folder / "config")
    return workspace


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    """A fresh folder with the small configuration and no logs."""
    return make_workspace(tmp_path / "work")


@pytest.fixture(scope="package")
def demonstration(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """A finished demonstration on two cores; tests only look at it."""
    workspace = make_workspace(tmp_path_factory.mktemp("demonstration") / "work")
    workspace.run_ok("--cores", "2")
    return workspace


@pytest.fixture
def flown(workspace: Workspace, demonstration: Workspace) -> Workspace:
    """A folder with one log of the demonstration and a file that is no log among the flights."""
    log = next(iter(sorted((demonstration.folder / "results" / "execute").glob("*.ulg"))))
    shutil.copy(log, workspace.folder / "flights" / "first.ulg")
    (workspace.folder / "flights" / "broken.ulg").write_bytes(b"this is no ULog")
    return workspace
