"""Where a section works: a revision's tree, a folder, and commands that are run there and measured."""

from __future__ import annotations

import ctypes
import os
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from benchmarks.speed.quantities import Failed

ROOT = Path(__file__).resolve().parents[2]
SHARED = Path(os.environ.get("FUSETUNE_SHARED") or ROOT.parent / "shared")
_BE_SUBREAPER = 36
_PATIENCE_S = 30.0


@dataclass(frozen=True)
class Cost:
    """What a command took, with all processes that it started."""

    cpu_s: float
    wall_s: float
    begun: float
    """Time of the clock, as files have it."""
    printed: str


@dataclass
class Workplace:
    """What a section is given."""

    tree: Path
    """The revision under test: a checkout or a copy of one."""
    scratch: Path
    """A folder of this measurement alone."""
    kept: Path
    """A folder whose files later measurements find."""
    quick: bool = False
    cores: int = 2
    _folders: int = field(default=0)

    def __post_init__(self) -> None:
        # What outlives its parent becomes a child of this process, so that its time is counted.
        if sys.platform == "linux":
            ctypes.CDLL(None).prctl(_BE_SUBREAPER, 1, 0, 0, 0)

    def folder(self) -> Path:
        """A new folder."""
        self._folders += 1
        folder = self.scratch / f"{self._folders}"
        folder.mkdir(parents=True)
        return folder

    def run(self, *command: str, tree: Path | None = None, cwd: Path | None = None) -> Cost:
        """Run a command with a revision's package; raises `Failed` with its last words where it fails."""
        tree = tree or self.tree
        environment = os.environ | {"PYTHONPATH": f"{tree / 'src'}{os.pathsep}{ROOT}", "PYTHONDONTWRITEBYTECODE": ""}
        # benchmark processes inherit kernels' folder from nobody
        environment.pop("NUMBA_CACHE_DIR", None)
        before, begun, started = _cpu_of_children(), time.time(), time.perf_counter()
        done = subprocess.run(
            command,
            cwd=cwd or self.scratch,
            env=environment,
            text=True,
            errors="replace",
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            check=False,
        )
        wall_s = time.perf_counter() - started
        _wait_for_orphans()
        if done.returncode:
            raise Failed(f"{' '.join(command[1:4])} … ended with {done.returncode}: {done.stdout[-1500:]}")
        return Cost(_cpu_of_children() - before, wall_s, begun, done.stdout)

    def python(self, code: str, *arguments: str, tree: Path | None = None) -> Cost:
        """Run Python code in a process of its own."""
        return self.run(sys.executable, "-P", "-c", code, *arguments, tree=tree)

    def project(self, logs: Mapping[str, Path], config: Mapping[str, Any] | None = None) -> Path:
        """A folder in which the pipeline can run: the tree's configuration, links to logs, and settings of its own."""
        folder = self.folder()
        shutil.copytree(self.tree / "config", folder / "config")
        if (self.tree / FORMERLY_AT_THE_TOP[1]).exists():
            shutil.copytree(self.tree / FORMERLY_AT_THE_TOP[1], folder / FORMERLY_AT_THE_TOP[1])
        (folder / "flights").mkdir()
        for name, log in logs.items():
            (folder / "flights" / f"{name}.ulg").symlink_to(log)
        if config:
            (folder / "config" / "config.yaml").write_text(yaml.safe_dump(dict(config)), encoding="utf-8")
        return folder

    def pipeline(self, folder: Path, *arguments: str, tree: Path | None = None) -> Cost:
        """Run the pipeline there."""
        snakefile = ["--snakefile", str(snakefile_of(tree or self.tree)), "--directory", str(folder)]
        command = [sys.executable, "-m", "snakemake", "--cores", str(self.cores), *snakefile, *arguments]
        return self.run(*command, tree=tree, cwd=folder)

    def copy_of_tree(self) -> Path:
        """The tree's files without anything that was compiled for them."""
        folder = self.folder()
        for name in ("pyproject.toml", *FORMERLY_AT_THE_TOP[:1]):
            if (self.tree / name).exists():
                shutil.copy(self.tree / name, folder / name)
        for name in ("src", "workflow", "config", *FORMERLY_AT_THE_TOP[1:]):
            if (self.tree / name).exists():
                shutil.copytree(self.tree / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        return folder


FORMERLY_AT_THE_TOP = ("Snakefile", "profiles")
"""What older revisions have beside `workflow/`, and newer ones in it."""


def snakefile_of(tree: Path) -> Path:
    """The Snakefile of a revision."""
    former = tree / FORMERLY_AT_THE_TOP[0]
    return former if former.is_file() else tree / "workflow" / "Snakefile"


def _cpu_of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _wait_for_orphans() -> None:
    """Wait for processes that a command left behind."""
    end = time.monotonic() + _PATIENCE_S
    while time.monotonic() < end:
        try:
            if os.waitpid(-1, os.WNOHANG) == (0, 0):
                time.sleep(0.02)
        except ChildProcessError:
            return
