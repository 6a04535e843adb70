"""How a run goes on where one before it was interrupted, and what it may believe of what lies there.

Snakemake marks the files of a job while it is at work. It looks for such marks before it knows the jobs behind a
checkpoint, so files of jobs that never ended would pass for finished ones there; taking them away makes them be made
again. What is said here of Snakemake's own folder holds for its persistence in files, which is the default.

All of this is for the process that holds the folder (`fusetune.running.run_lock`), and for no other.
"""

from __future__ import annotations

import base64
import os
import shutil
import uuid
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from fusetune.running.run_lock import Claim
from fusetune.storage.files import AnyPath, atomic_path

MADE_UNDER = "fusetune_results.id"
"""File in Snakemake's folder and, hidden, in that of the results: the same text in both where they belong together."""

_INCOMPLETE = "incomplete"


@dataclass(frozen=True)
class Unfinished:
    """A file, or folder, of a job that began and never ended."""

    file: Path
    marker: Path


def unfinished_files(state: AnyPath, parts: Iterable[AnyPath]) -> Iterator[Unfinished]:
    """What jobs that never ended were to make.

    Parameters
    ----------
    state
        Snakemake's folder.
    parts
        Files and folders of this workflow. Others, which other workflows in the same place make, are left out.
    """
    state, own = Path(state), [Path(os.path.abspath(part)) for part in parts]
    # Snakemake names a marker by the name of the file in base 64, cut into folders that begin with '@'.
    for marker in sorted((state / _INCOMPLETE).rglob("*")):
        if not marker.is_file():
            continue
        cuts = marker.relative_to(state / _INCOMPLETE).parts
        try:
            name = base64.urlsafe_b64decode("".join(cut.removeprefix("@") for cut in cuts)).decode()
        except ValueError:
            continue
        file = Path(os.path.abspath(name))
        if any(file == part or part in file.parents for part in own):
            yield Unfinished(Path(name), marker)


def remove_unfinished(files: Iterable[Unfinished]) -> None:
    """Take files of jobs that never ended away, and the markers after them: a second try finds what is left."""
    for unfinished in list(files):
        remove(unfinished.file)
        unfinished.marker.unlink(missing_ok=True)


def remove_stale_locks(state: AnyPath, claim: Claim) -> None:
    """Take away the locks that Snakemake keeps as files, where the run that made them was ended.

    After a run that ended by itself there are none of its own: those that are there belong to someone else.
    """
    if claim.locked and claim.former is not None:
        for lock in (Path(state) / "locks").glob("*.lock"):
            lock.unlink(missing_ok=True)


def belong_together(state: AnyPath, results: AnyPath) -> bool:
    """Whether what Snakemake remembers is about these results; without it, it takes any file for up to date."""
    known, made = _text(Path(state) / MADE_UNDER), _text(Path(results) / f".{MADE_UNDER}")
    return known == made and known != ""


def bind_together(state: AnyPath, results: AnyPath) -> None:
    """Mark that what Snakemake will remember is about these results."""
    name = uuid.uuid4().hex + "\n"
    for file in (Path(state) / MADE_UNDER, Path(results) / f".{MADE_UNDER}"):
        with atomic_path(file) as temporary:
            temporary.write_text(name, encoding="ascii")


def link_to(target: AnyPath, link: AnyPath) -> None:
    """Let a link lead to a folder, whatever stood in its place; where links cannot be made there is none."""
    link = Path(link)
    if link.is_symlink() and os.readlink(link) == os.fspath(target):
        return
    with suppress(OSError):
        link.parent.mkdir(parents=True, exist_ok=True)
        remove(link)
        link.symlink_to(target, target_is_directory=True)


def remove(path: AnyPath) -> None:
    """Remove a file, link or folder, if it is there."""
    path = Path(path)
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="ascii")
    except (OSError, ValueError):
        return ""
