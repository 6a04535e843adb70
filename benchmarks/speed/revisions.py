"""The revision at hand, and another one beside it."""

from __future__ import annotations

import io
import shutil
import subprocess
import tarfile
from dataclasses import dataclass
from pathlib import Path

from benchmarks.speed.workplace import ROOT

KEPT = ROOT / ".cache" / "benchmarks"
"""Simulated flights and other revisions with what is compiled for them; `make clean` removes it."""


@dataclass(frozen=True)
class Revision:
    """A state of the sources and where it lies."""

    name: str
    tree: Path


def at_hand() -> Revision:
    """The checkout that this file is part of."""
    name = _git("describe", "--always", "--abbrev=8", "--dirty= + changes")
    return Revision(name or "this checkout", ROOT)


def other(revision: str) -> Revision:
    """Another revision, taken out of the repository once, with a kernel cache of its own.

    Raises
    ------
    SystemExit
        The repository has no such revision.
    """
    commit = _git("rev-parse", "--verify", "--quiet", f"{revision}^{{commit}}")
    if not commit:
        raise SystemExit(f"--against {revision}: this repository has no such revision")
    tree = KEPT / "revisions" / commit[:12]
    if not (tree / "pyproject.toml").is_file():
        shutil.rmtree(tree, ignore_errors=True)
        unfinished = tree.with_suffix(".unfinished")
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir(parents=True)
        archive = subprocess.run(["git", "archive", commit], cwd=ROOT, check=True, capture_output=True).stdout
        with tarfile.open(fileobj=io.BytesIO(archive)) as files:
            files.extractall(unfinished, filter="data")
        unfinished.rename(tree)
    return Revision(f"{revision} ({commit[:8]})" if not commit.startswith(revision) else commit[:8], tree)


def _git(*arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=ROOT, check=False, capture_output=True, text=True)
    return done.stdout.strip()
