"""What the whole pipeline decides: run on logs, or read from a folder of results."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from fusetune.design.parameter_check import checked_values
from fusetune.errors import UserError
from fusetune.library.comparison import ranking_table
from fusetune.library.log import Log
from fusetune.running.worker_processes import all_cores
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_table

_DECISION = Path("apply", "decision.json")


@dataclass(frozen=True)
class Decision:
    """The decision for one vehicle.

    Attributes
    ----------
    is_change : whether other parameters are to be loaded
    chosen : the set to fly; that of the present parameters where nothing is to be changed
    is_exploratory : whether there are fewer flights than it takes to be more than a hint
    answer : the decision and why, in sentences
    changes : one row per parameter to load: `name`, `previous`, `new`
    next_steps : what to do now, in sentences
    ranking : one row per set, see `Comparison.ranking`
    document : all of it, as `decision.json` holds it
    folder : the results; None where nothing was kept
    """

    is_change: bool
    chosen: str
    is_exploratory: bool
    answer: str
    changes: pd.DataFrame
    next_steps: list[str]
    ranking: pd.DataFrame
    document: dict[str, Any]
    folder: Path | None

    def __str__(self) -> str:
        return self.answer


def decide(
    logs: AnyPath | Sequence[AnyPath | Log],
    sets: Mapping[str, Mapping[str, float]] | None = None,
    *,
    folder: AnyPath | None = None,
    cores: int | None = None,
) -> Decision:
    """Run the pipeline on logs and say what it decides; or read what it decided.

    Parameters
    ----------
    logs : `.ulg` files, or what `read` gave; or one folder of results (`results`), which is only read
    sets : name → the parameters in which it differs from the present ones; by default steps up and down around the
        present values of what the flights exercise
    folder : takes `results/`, and goes on from what is there; by default nothing is kept
    cores : jobs at a time; by default all cores

    Raises
    ------
    UserError
        No log can be used, or the folder holds no results.
    """
    if isinstance(logs, (str, Path)) or not isinstance(logs, Sequence):
        return read_decision(logs)
    paths = [(one.path if isinstance(one, Log) else Path(one)).resolve() for one in logs]
    with tempfile.TemporaryDirectory(prefix="fusetune_decide_") as scratch:
        place = Path(scratch if folder is None else folder).resolve()
        place.mkdir(parents=True, exist_ok=True)
        _run(paths, place, sets, cores or all_cores())
        return read_decision(place / "results", kept=folder is not None)


def read_decision(results: AnyPath, *, kept: bool = True) -> Decision:
    """Read the decision of a folder of results.

    Raises
    ------
    UserError
        It holds none.
    """
    folder = Path(results)
    file = folder / _DECISION
    if not file.is_file():
        raise UserError(folder, "holds no apply/decision.json", "Name a folder of results, or give a list of logs")
    document = read_document(file)
    return Decision(
        is_change=document["status"] == "change",
        chosen=document["chosen"],
        is_exploratory=document["exploratory"],
        answer=document["paragraph"],
        changes=pd.DataFrame(document["changes"]),
        next_steps=[one["text"] for one in document["next_steps"]],
        ranking=ranking_table(read_table(folder / "apply" / "ranking.parquet").to_pandas()),
        document=document,
        folder=folder if kept else None,
    )


def _run(logs: Sequence[Path], place: Path, sets: Mapping[str, Mapping[str, float]] | None, cores: int) -> None:
    command = [sys.executable, "-m", "fusetune.cli", "run", "--cores", str(cores), "--quiet"]
    if sets is not None:
        command += ["--study", str(_write_study(place, sets))]
    ended = subprocess.run([*command, "--", *map(str, logs)], cwd=place, capture_output=True, text=True, check=False)
    if ended.returncode not in (0, 1):
        told = [line for line in ended.stderr.splitlines() if line.strip()] or ["no word on why"]
        raise UserError(place, f"the pipeline failed: {told[-1].removeprefix('fusetune: ').rstrip('.')}",
                        "See results/logs in a folder of your own (folder=…)")  # fmt: skip


def _write_study(place: Path, sets: Mapping[str, Mapping[str, float]]) -> Path:
    document = {
        "name": "asked",
        "kind": "list",
        "sets": [{"name": name, "parameters": checked_values(values, f"set {name}")} for name, values in sets.items()],
    }
    file = place / "asked_study.yaml"
    file.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
    return file
