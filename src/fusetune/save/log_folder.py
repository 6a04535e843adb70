"""From a log to its folder of tables, with the verdict whether it can be replayed."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fusetune.errors import UserError
from fusetune.px4.ekf2_parameters import migrate
from fusetune.px4.flight import Flight
from fusetune.px4.release_layouts import canonical
from fusetune.px4.ulog_reader import file_checksum, read_ulog
from fusetune.save.discovery import printable
from fusetune.save.flight_folder import METADATA_FILE, write_flight
from fusetune.save.log_facts import log_facts
from fusetune.save.verdict import Verdict, VerdictThresholds, judge, unreadable

VERDICT_FILE = "verdict.json"


def save_log(
    log: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    thresholds: VerdictThresholds | None = None,
    *,
    shown: str | None = None,
    checksum: str | None = None,
) -> Verdict:
    """Save a log: tables, `metadata.json` and `verdict.json`, which `metadata.json` repeats.

    The folder appears as a whole or not at all; one of an earlier run is replaced. A log that cannot be read gets a
    folder that says why, and no error is raised.

    Parameters
    ----------
    log
        ULog file.
    folder
        Folder of the flight, by whose name the flight is known.
    thresholds
        From where on a flight can be replayed.
    shown
        The file as it is told of; its name by default.
    checksum
        SHA-256 that the log has to have. With another one it is refused: it changed after it was asked for.

    Raises
    ------
    UserError
        The folder cannot be written.
    """
    target = Path(folder)
    partial = target.with_name(f".{target.name}.partial")
    try:
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        source = _Source(Path(log), target.name, shown or printable(Path(log).name), checksum)
        verdict = _write(source, partial, thresholds or VerdictThresholds())
        shutil.rmtree(target, ignore_errors=True)
        os.replace(partial, target)
    except OSError as error:
        shutil.rmtree(partial, ignore_errors=True)
        raise UserError(target, f"cannot be written: {error.strerror}", "Make room or mend its permissions") from error
    return verdict


@dataclass(frozen=True)
class _Source:
    log: Path
    flight: str
    shown: str
    checksum: str | None


def _write(source: _Source, folder: Path, thresholds: VerdictThresholds) -> Verdict:
    try:
        flight = replace(read_ulog(source.log), name=source.flight)
        _demand_checksum(source, flight.checksum)
    except UserError as error:
        verdict = unreadable(source.flight, error)
        _write_json(folder / METADATA_FILE, _metadata_of_unreadable(source) | {"verdict": verdict.document()})
    else:
        verdict = _judge(flight, thresholds)
        extra = {"file": source.shown, "ekf2_parameters": _present_ekf2(flight), "verdict": verdict.document()}
        write_flight(folder, flight, extra | log_facts(flight))
    _write_json(folder / VERDICT_FILE, verdict.document())
    return verdict


def _demand_checksum(source: _Source, read: str) -> None:
    if source.checksum not in (None, read):
        reason = "changed between the start of the run and its reading"
        raise UserError(source.log, reason, "Run the pipeline again when nothing writes to the log any more")


def _judge(flight: Flight, thresholds: VerdictThresholds) -> Verdict:
    try:
        return judge(canonical(flight), thresholds)
    except (LookupError, ValueError, TypeError, ArithmeticError) as error:
        # damage can take any field away from any topic
        reason = f"holds topics that lack fields every release has ({type(error).__name__}: {error})"
        return unreadable(flight.name, UserError(flight.name, reason, "Copy the log from the vehicle again"))


def _present_ekf2(flight: Flight) -> dict[str, float]:
    """EKF2 parameters at the end of the log under the names of the baseline release."""
    return migrate(flight.parameters.at_end(), flight.release)


def _metadata_of_unreadable(source: _Source) -> dict[str, Any]:
    try:
        checksum, size = file_checksum(source.log), source.log.stat().st_size
    except (UserError, OSError):
        checksum, size = "", 0
    return {"name": source.flight, "file": source.shown, "checksum": checksum, "size_bytes": size}


def _write_json(file: Path, document: dict[str, Any]) -> None:
    file.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
