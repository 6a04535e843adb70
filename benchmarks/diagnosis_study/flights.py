"""Flies the study's cases and keeps each as log, saved flight and what is wrong with it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from fusetune.execute.simulation import simulate
from fusetune.save import save_log
from fusetune.storage.files import atomic_path

from .cases import Case

FAULT_FILE = "fault.json"


def folder_of(flights: Path, case: Case) -> Path:
    """Where a case is kept: log and saved flight with its name, and `fault.json`."""
    return flights / case.group / f"{case.number:02}"


def is_flown(flights: Path, case: Case) -> bool:
    """Whether it is there as a whole, from the same injection."""
    file = folder_of(flights, case) / FAULT_FILE
    return file.is_file() and json.loads(file.read_text(encoding="utf-8")) == _plain(case)


def fly_case(flights: Path, case: Case) -> Path:
    """Fly a case unless it is there; `fault.json` comes last. Returns its folder."""
    folder = folder_of(flights, case)
    if is_flown(flights, case):
        return folder
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    log = folder / f"{case.name}.ulg"
    simulate(case.mission, case.vehicle, {}, case.seed, case.faults, log)
    save_log(log, folder / case.name)
    with atomic_path(folder / FAULT_FILE) as temporary:
        temporary.write_text(json.dumps(_plain(case), indent=1), encoding="utf-8")
    return folder


def _plain(case: Case) -> object:
    """The document as JSON gives it back."""
    return json.loads(json.dumps(case.document()))
