"""From a log to its folder of tables, with the verdict whether it can be replayed."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fusetune.errors import OF_DAMAGE, UserError
from fusetune.px4.flight import Flight
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.parameters.ekf2_parameters import migrate
from fusetune.px4.parameters.logged_parameters import checked_history
from fusetune.px4.releases import AUTO, Release
from fusetune.px4.ulog.reader import file_checksum, read_ulog, takes_too_long
from fusetune.px4.ulog.reading_limits import ReadingLimits
from fusetune.save.discovery import printable
from fusetune.save.flight_folder import METADATA_FILE, write_flight
from fusetune.save.log_facts import log_facts
from fusetune.save.replayed_release import replayed_release
from fusetune.save.thresholds import VerdictThresholds
from fusetune.save.verdict import Verdict, judge, unreadable
from fusetune.storage.documents import write_document
from fusetune.time_limit import Deadline, TimeLimitError

VERDICT_FILE = "verdict.json"


def save_log(
    log: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    thresholds: VerdictThresholds | None = None,
    limits: ReadingLimits | None = None,
    *,
    shown: str | None = None,
    checksum: str | None = None,
    release: str = AUTO,
) -> Verdict:
    """Save a log: tables, `metadata.json` and `verdict.json`, which `metadata.json` repeats.

    The folder appears as a whole or not at all; one of an earlier run is replaced. A log that cannot be read, or not
    in time, gets a folder that says why, and no error is raised.

    Parameters
    ----------
    log
        ULog file.
    folder
        Folder of the flight, by whose name the flight is known.
    thresholds
        From where on a flight can be replayed.
    limits
        How many tables the log may have, and how long all this may take.
    shown
        The file as it is told of; its name by default.
    checksum
        SHA-256 that the log has to have. With another one it is refused: it changed after it was asked for.
    release
        Whose estimator is asked to replay it, as in the configuration.

    Raises
    ------
    UserError
        The folder cannot be written, or is there already and holds something else than a saved flight.
    """
    target, limits = Path(folder), limits or ReadingLimits()
    _demand_own(target)
    partial = target.with_name(f".{target.name}.partial")
    try:
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        source = _Source(Path(log), target.name, shown or printable(Path(log).name), checksum, release)
        verdict = _write(source, partial, thresholds or VerdictThresholds(), limits)
        shutil.rmtree(target, ignore_errors=True)
        os.replace(partial, target)
    except OSError as error:
        shutil.rmtree(partial, ignore_errors=True)
        # libraries tell in their own words what the number says in the system's
        reason = f"cannot be written: {os.strerror(error.errno) if error.errno else error}"
        raise UserError(target, reason, "Make room or mend its permissions") from error
    return verdict


def demand_own_folders(logs: Sequence[str | os.PathLike[str]]) -> None:
    """Each log gets a folder by its name.

    Raises
    ------
    UserError
        A log has no name, or two have names that some file system takes for the same.
    """
    first: dict[str, Path] = {}
    for log in map(Path, logs):
        if log.stem in ("", ".", ".."):
            raise UserError(log, "gives no name to a folder", "Rename it")
        other = first.setdefault(log.stem.casefold(), log)
        if other is not log:
            raise UserError(log, f"would be saved into the same folder as {other}", "Rename one, or save it elsewhere")


@dataclass(frozen=True)
class _Source:
    log: Path
    flight: str
    shown: str
    checksum: str | None
    release: str


def _demand_own(folder: Path) -> None:
    """What is replaced is a saved flight, or what is left of one; never anything else that bears the log's name."""
    if not folder.exists() or (folder / METADATA_FILE).exists() or (folder / VERDICT_FILE).exists():
        return
    if not folder.is_dir() or any(
        not file.name.startswith(".") and file.suffix != ".parquet" for file in folder.iterdir()
    ):
        raise UserError(folder, "is there already and holds no saved flight", "Save elsewhere, or remove it yourself")


def _write(source: _Source, folder: Path, thresholds: VerdictThresholds, limits: ReadingLimits) -> Verdict:
    deadline = Deadline(limits.time_limit_s)
    try:
        verdict = _write_readable(source, folder, thresholds, limits, deadline)
    except (UserError, TimeLimitError) as error:
        told = error if isinstance(error, UserError) else takes_too_long(source.log, deadline)
        verdict = unreadable(source.flight, told)
        for table in folder.glob("*.parquet"):
            table.unlink()
        write_document(folder / METADATA_FILE, _metadata_of_unreadable(source) | {"verdict": verdict.document()})
    write_document(folder / VERDICT_FILE, verdict.document())
    return verdict


def _write_readable(
    source: _Source, folder: Path, thresholds: VerdictThresholds, limits: ReadingLimits, deadline: Deadline
) -> Verdict:
    flight = replace(read_ulog(source.log, limits, deadline), name=source.flight)
    _demand_checksum(source, flight.checksum)
    verdict = _judge(flight, thresholds, deadline, source.release)
    replayed = replayed_release(flight, source.release)
    release = replayed.document()
    extra = {
        "file": source.shown,
        "release": release,
        "ekf2_parameters": _present_ekf2(flight, replayed.release),
        "verdict": verdict.document(),
    }
    write_flight(folder, flight, extra | log_facts(flight), deadline)
    return verdict


def _demand_checksum(source: _Source, read: str) -> None:
    if source.checksum not in (None, read):
        reason = "changed between the start of the run and its reading"
        raise UserError(source.log, reason, "Run the pipeline again when nothing writes to the log any more")


def _judge(flight: Flight, thresholds: VerdictThresholds, deadline: Deadline, release: str) -> Verdict:
    try:
        return judge(canonical(flight), thresholds, deadline, release)
    except OF_DAMAGE as error:
        reason = f"holds topics that lack fields every release has ({type(error).__name__}: {error})"
        return unreadable(flight.name, UserError(flight.name, reason, "Copy the log from the vehicle again"))


def _present_ekf2(flight: Flight, replayed: Release) -> dict[str, float]:
    """EKF2 parameters at the end of the log, as the estimator that replays it reads them."""
    return migrate(checked_history(flight.parameters, flight.release)[0].at_end(), flight.release, replayed)


def _metadata_of_unreadable(source: _Source) -> dict[str, Any]:
    try:
        checksum, size = file_checksum(source.log), source.log.stat().st_size
    except (UserError, OSError):
        checksum, size = "", 0
    return {"name": source.flight, "file": source.shown, "checksum": checksum, "size_bytes": size}
