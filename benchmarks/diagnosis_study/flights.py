"""Flies the study's cases and keeps each as log, saved flight and what is wrong with it."""

from __future__ import annotations

import hashlib
import json
import shutil
import tempfile
from functools import cache
from pathlib import Path

from benchmarks.decision_study.collect import stamp

from fusetune.execute.simulation import simulate
from fusetune.save import save_log
from fusetune.storage.digest import source_digest

from .cases import Case

FAULT_FILE = "fault.json"


def folder_of(flights: Path, case: Case) -> Path:
    """Where a case is kept: log and saved flight with its name, and `fault.json`."""
    return flights / case.group / f"{case.number:02}"


def is_flown(flights: Path, case: Case) -> bool:
    """Whether it is there as a whole, flown by the same simulation with the same injection."""
    folder = folder_of(flights, case)
    file = stamp(folder)
    return folder.is_dir() and file.is_file() and file.read_text(encoding="utf-8") == _made_from(case)


def fly_case(flights: Path, case: Case) -> Path:
    """Fly a case unless it is there; its folder appears as a whole and is returned."""
    folder = folder_of(flights, case)
    if is_flown(flights, case):
        return folder
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".flying_", dir=folder.parent) as scratch:
        made = Path(scratch, folder.name)
        made.mkdir()
        log = made / f"{case.name}.ulg"
        simulate(case.mission, case.vehicle, {}, case.seed, case.faults, log)
        save_log(log, made / case.name)
        (made / FAULT_FILE).write_text(_document(case), encoding="utf-8")
        stamp(folder).unlink(missing_ok=True)
        shutil.rmtree(folder, ignore_errors=True)
        made.rename(folder)
    stamp(folder).write_text(_made_from(case), encoding="utf-8")
    return folder


def _document(case: Case) -> str:
    return json.dumps(case.document(), indent=1)


@cache
def _simulation() -> str:
    return source_digest("design", "execute")


def _made_from(case: Case) -> str:
    return hashlib.sha256(f"{_simulation()} {_document(case)} {case.mission} {case.vehicle}".encode()).hexdigest()
