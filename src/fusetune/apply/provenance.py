"""Where a decision comes from: every log by checksum, every configuration file by hash, product and firmware."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import fusetune
from fusetune.apply.evidence import AnalyzedFlight
from fusetune.errors import UserError
from fusetune.running.workflow_files import pipeline_folder
from fusetune.storage.files import AnyPath, sha256_of
from fusetune.storage.parquet import read_table

_FLIGHT_COLUMNS = ("flight", "status", "reason", "firmware", "checksum", "duration_s", "airborne_s")


def file_hash(path: AnyPath) -> str:
    """SHA-256 of a file.

    Raises
    ------
    UserError
        If the file cannot be read.
    """
    try:
        return sha256_of(path)
    except OSError as error:
        raise UserError(path, f"cannot be read: {error.strerror}", "Name configuration files that exist") from error


def flight_rows(flights_table: AnyPath, flights: Sequence[AnalyzedFlight]) -> list[dict[str, Any]]:
    """One row per log, refused ones too: verdict, firmware, checksum, and whether it entered the decision."""
    analyzed = {flight.name: flight for flight in flights}
    rows = []
    for row in read_table(flights_table).to_pylist():
        flight = analyzed.get(row["flight"])
        entry = {name: row.get(name) for name in _FLIGHT_COLUMNS}
        entry["scored"] = flight is not None and flight.evidence is not None
        entry["scored_s"] = flight.summary["scored_s"] if entry["scored"] and flight is not None else 0.0
        if flight is not None and flight.evidence is None:
            entry["reason"] = flight.reason
        rows.append(entry)
    return sorted(rows, key=lambda entry: str(entry["flight"]))


def provenance(configuration_files: Sequence[AnyPath]) -> dict[str, Any]:
    """Version of the product and hashes of the configuration."""
    return {
        "product": f"fusetune {fusetune.__version__}",
        "configuration_files": {_label(path): file_hash(path) for path in sorted(map(Path, configuration_files))},
    }


def _label(path: Path) -> str:
    """A name that does not depend on where the project, or the package, lies on the disk."""
    if path.is_relative_to(pipeline_folder()):
        path = path.relative_to(pipeline_folder())
    return path.name if path.is_absolute() else path.as_posix()
