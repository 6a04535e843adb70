"""From a log to its folder of tables, with the verdict whether it can be replayed."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

from fusetune.documents import write_document
from fusetune.errors import UserError
from fusetune.px4.ekf2_parameters import migrate
from fusetune.px4.flight import Flight
from fusetune.px4.release_layouts import canonical
from fusetune.px4.ulog_reader import file_checksum, read_ulog
from fusetune.save.flight_folder import METADATA_FILE, write_flight
from fusetune.save.log_facts import log_facts
from fusetune.save.verdict import Verdict, VerdictThresholds, judge, unreadable

VERDICT_FILE = "verdict.json"


def save_log(
    log: str | os.PathLike[str], folder: str | os.PathLike[str], thresholds: VerdictThresholds | None = None
) -> Verdict:
    """Save a log: tables, `metadata.json` and `verdict.json`, which `metadata.json` repeats.

    The folder appears as a whole or not at all; one of an earlier run is replaced. A log that cannot be read gets a
    folder that says why, and no error is raised.

    Parameters
    ----------
    log
        ULog file.
    folder
        Folder of the flight.
    thresholds
        From where on a flight can be replayed.

    Raises
    ------
    UserError
        The folder cannot be written, or is there already and holds something else than a saved flight.
    """
    target = Path(folder)
    _demand_own(target)
    partial = target.with_name(f".{target.name}.partial")
    try:
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        verdict = _write(Path(log), partial, thresholds or VerdictThresholds())
        shutil.rmtree(target, ignore_errors=True)
        os.replace(partial, target)
    except OSError as error:
        raise UserError(target, f"cannot be written: {error.strerror}", "Make room or mend its permissions") from error
    return verdict


def _demand_own(folder: Path) -> None:
    """What is replaced is a saved flight, or what is left of one; never anything else that bears the log's name."""
    if not folder.exists() or (folder / METADATA_FILE).exists() or (folder / VERDICT_FILE).exists():
        return
    if not folder.is_dir() or any(
        not file.name.startswith(".") and file.suffix != ".parquet" for file in folder.iterdir()
    ):
        raise UserError(folder, "is there already and holds no saved flight", "Save elsewhere, or remove it yourself")


def _write(log: Path, folder: Path, thresholds: VerdictThresholds) -> Verdict:
    try:
        flight = read_ulog(log)
    except UserError as error:
        verdict = unreadable(log.stem, error)
        write_document(folder / METADATA_FILE, _metadata_of_unreadable(log) | {"verdict": verdict.document()})
    else:
        verdict = _judge(flight, thresholds)
        extra = {"file": log.name, "ekf2_parameters": _present_ekf2(flight), "verdict": verdict.document()}
        write_flight(folder, flight, extra | log_facts(flight))
    write_document(folder / VERDICT_FILE, verdict.document())
    return verdict


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


def _metadata_of_unreadable(log: Path) -> dict[str, Any]:
    try:
        checksum, size = file_checksum(log), log.stat().st_size
    except (UserError, OSError):
        checksum, size = "", 0
    return {"name": log.stem, "file": log.name, "checksum": checksum, "size_bytes": size}
