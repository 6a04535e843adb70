"""A folder of one's own for the pipeline: its configuration, a place for logs, and a word on both."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

from fusetune.errors import UserError, write_error
from fusetune.running.workflow_files import packaged_config
from fusetune.storage.files import AnyPath, atomic_path

FLIGHTS, CONFIG, RESULTS = "flights", "config", "results"
README = "README.md"

_TEXT = """\
# Which EKF2 parameters?

1. Put flight logs (`.ulg`) into `flights/`, five flights or more; folders in it are searched, too.
2. `fusetune run`, here. While `flights/` is empty, simulated flights show what it does.
3. Open `results/report.html`. What it recommends is `results/apply/best_params.params`: load it in QGroundControl, or
   with `fusetune upload results/apply/best_params.params --to VEHICLE`.

`fusetune run` again computes only what is new. `fusetune --help` lists all else.

| | |
|---|---|
| `flights/` | your logs, or links to them (`fusetune run LOG…` makes such links) |
| `config/config.yaml` | all settings with their defaults; `config/README.md` explains each |
| `config/studies/` | parameter sets to compare: `fusetune run --study config/studies/NAME.yaml` |
| `config/missions/`, `config/vehicles/` | missions to fly and vehicles, for the simulation and for planning |
| `results/` | made by `fusetune run`; may be deleted, but for `results/history`, which remembers what was decided |
"""

_SCHEMA_LINE = re.compile(r"^# yaml-language-server:.*\n", re.MULTILINE)
_LINK_TO_DOCS = re.compile(r"\[([^\]]*)\]\(\.\./([^)]*)\)")


def make_project_folder(folder: AnyPath) -> Path:
    """Make a folder for the pipeline.

    Returns
    -------
    The folder

    Raises
    ------
    UserError
        Something of what is to be written is there already, or the folder cannot be written.
    """
    folder = Path(folder)
    for name in (CONFIG, FLIGHTS, README):
        there = folder / name
        if there.exists() or there.is_symlink():
            raise UserError(
                there, "is there already, and nothing is written over", "Name a new folder, or move it away"
            )
    try:
        _write(folder)
    except OSError as error:
        raise write_error(error, folder) or UserError(
            folder, f"cannot be made ({error.strerror or error})", "Name another folder"
        ) from error
    return folder


def link_results(folder: AnyPath, target: AnyPath) -> None:
    """Let the results of a folder lie elsewhere, behind a link; the place is made where there is none.

    Raises
    ------
    UserError
        There are results in the folder already, or it takes no links.
    """
    own, place = Path(folder) / RESULTS, Path(os.path.abspath(target))
    place.mkdir(parents=True, exist_ok=True)
    if os.path.realpath(own) == os.path.realpath(place):
        return
    if own.is_symlink() or own.exists():
        raise UserError(own, "is there already", f"Move it to {target}, or leave out --results")
    try:
        own.symlink_to(place, target_is_directory=True)
    except (OSError, NotImplementedError) as error:
        raise UserError(own, f"cannot be a link to {target} ({error})", "Leave out --results") from error


def _write(folder: Path) -> None:
    (folder / FLIGHTS).mkdir(parents=True)
    shutil.copytree(packaged_config(), folder / CONFIG, ignore=shutil.ignore_patterns(".*"))
    for path, _, names in os.walk(folder / CONFIG):
        for name in names:
            # what is packaged may be read-only
            os.chmod(os.path.join(path, name), 0o644)
    for name in ("config.yaml", README):
        _rewrite(folder / CONFIG / name, _without_the_checkout)
    with atomic_path(folder / README) as temporary:
        temporary.write_text(_TEXT, encoding="utf-8")


def _without_the_checkout(text: str) -> str:
    """A text of the configuration without links to what lies beside it in a checkout alone."""

    def named(link: re.Match[str]) -> str:
        words, target = link.groups()
        return words if words == target else f"{words} ({target})"

    return _LINK_TO_DOCS.sub(named, _SCHEMA_LINE.sub("", text))


def _rewrite(file: Path, changed: Callable[[str], str]) -> None:
    if file.is_file():
        text = changed(file.read_text(encoding="utf-8"))
        with atomic_path(file) as temporary:
            temporary.write_text(text, encoding="utf-8")
