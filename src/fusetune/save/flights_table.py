"""One table of all flights with their verdicts."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa

from fusetune.finding import Finding, Severity, documents, from_documents, of_severity
from fusetune.px4.vehicle_identity import VehicleIdentity
from fusetune.save.discovery import RefusedEntry
from fusetune.save.flight_folder import METADATA_FILE, read_flight_document
from fusetune.save.flights_sheet import CHECKS_SHEET, FLIGHTS_SHEET
from fusetune.save.log_folder import VERDICT_FILE
from fusetune.storage.checksum_file import write_checksum
from fusetune.storage.csv_file import write_csv
from fusetune.storage.files import AnyPath, atomic_path
from fusetune.storage.parquet import read_table, write_table

SCHEMA = pa.schema(
    [
        ("flight", pa.string()),
        ("file", pa.string()),
        ("status", pa.string()),
        ("reason", pa.string()),
        ("remedy", pa.string()),
        ("warnings", pa.string()),
        ("checks", pa.string()),
        ("firmware", pa.string()),
        ("replayed_as", pa.string()),
        ("hardware", pa.string()),
        *((name, pa.string()) for name in VehicleIdentity().columns()),
        ("recorded", pa.string()),
        ("duration_s", pa.float64()),
        ("airborne_s", pa.float64()),
        ("checksum", pa.string()),
        ("size_bytes", pa.int64()),
        ("advice", pa.list_(pa.struct([(name, pa.string()) for name in ("id", "severity", "found", "remedy")]))),
    ]
)
"""Columns of the table: `status` is replayable or refused, `reason` says why a flight is refused.

`file` is the path of the log below the folder of flights.
`vehicle` is the short name of who flew, the columns behind it what it is made of (`fusetune.px4.vehicle_identity`);
all are empty where the log could not be read.
`checks` holds id, severity and figure of every check's finding; `advice` those that did not pass and have a remedy, as
findings (`fusetune.finding.from_documents`). The sheets have each of them in a row of its own.
"""

CHECKS_SCHEMA = pa.schema(
    [
        *((name, pa.string()) for name in ("flight", "id", "severity")),
        *((name, pa.float64()) for name in ("figure", "threshold")),
        ("unit", pa.string()),
        *((name, pa.float64()) for name in ("from_boot_s", "to_boot_s")),
        *((name, pa.string()) for name in ("found", "remedy")),
    ]
)
"""Columns of the table of checks, findings of each flight in their order; times in s since boot."""

_DUPLICATE = "duplicate"

_COUNTED: dict[str, Severity] = {"failed_checks": "fail", "warning_checks": "warning"}


def write_flights_table(
    folders: Sequence[str | os.PathLike[str]],
    table: str | os.PathLike[str],
    csv: str | os.PathLike[str],
    refused: Sequence[RefusedEntry] = (),
    checks: str | os.PathLike[str] | None = None,
) -> list[dict[str, Any]]:
    """Put the verdicts of saved flights into one table, in the order given, as Parquet and as CSV.

    Where asked for, the checks of all flights go into another CSV, each a row.

    What was `refused` before it could be saved comes last.

    Of flights whose logs have equal bytes the first by name stays; the others are refused, so that no flight counts
    twice. Which is first depends on neither the order given nor that of the jobs.

    Returns
    -------
    The rows of the table.

    Raises
    ------
    UserError
        A folder lacks its verdict or its metadata.
    """
    found = [_row(Path(folder)) for folder in folders]
    _refuse_duplicates(found)
    found += [_row_of_refused(entry) for entry in refused]
    findings = [row.pop("findings") for row in found]
    rows = pa.Table.from_pylist(found, schema=SCHEMA)
    with atomic_path(table) as temporary:
        write_table(rows, temporary)
    for name, severity in _COUNTED.items():
        counts = [len(of_severity(of_flight, severity)) for of_flight in findings]
        rows = rows.append_column(name, pa.array(counts, pa.int64()))
    write_csv(csv, rows, FLIGHTS_SHEET)
    write_checksum(csv)
    if checks is not None:
        of_checks = [
            _row_of_check(row["flight"], one) for row, told in zip(found, findings, strict=True) for one in told
        ]
        write_csv(checks, pa.Table.from_pylist(of_checks, schema=CHECKS_SCHEMA), CHECKS_SHEET)
    return found


def _row_of_check(flight: str, finding: Finding) -> dict[str, Any]:
    times = {"from_boot_s": finding.start_us, "to_boot_s": finding.stop_us}
    in_seconds = {name: None if time is None else time / 1e6 for name, time in times.items()}
    return {"flight": flight, **finding.document(), **in_seconds}


def _row(folder: Path) -> dict[str, Any]:
    verdict, metadata = (read_flight_document(folder / name) for name in (VERDICT_FILE, METADATA_FILE))
    return {
        "flight": verdict["flight"],
        "file": metadata["file"],
        "status": verdict["status"],
        "firmware": metadata.get("firmware", "unknown"),
        "replayed_as": metadata.get("release", {}).get("replayed", ""),
        "hardware": str(metadata.get("hardware", {}).get("ver_hw", "")),
        **{name: str(metadata.get(name, "")) for name in VehicleIdentity().columns()},
        "recorded": metadata.get("recorded", ""),
        "duration_s": metadata.get("duration_s"),
        "airborne_s": metadata.get("airborne_s"),
        "checksum": metadata["checksum"],
        "size_bytes": metadata["size_bytes"],
    } | _told(from_documents(verdict["findings"]))


def _row_of_refused(entry: RefusedEntry) -> dict[str, Any]:
    row = dict.fromkeys(("hardware", "replayed_as", *VehicleIdentity().columns(), "recorded", "checksum"), "") | {
        "firmware": "unknown",
        "size_bytes": 0,
    }
    row |= {"flight": entry.flight, "file": entry.shown, "status": "refused"}
    return row | _told([Finding("readable", "fail", entry.reason, entry.remedy)])


def _refuse_duplicates(rows: list[dict[str, Any]]) -> None:
    first: dict[str, str] = {}
    for row in sorted(rows, key=lambda row: str(row["flight"])):
        if row["status"] != "replayable":
            continue
        original = first.setdefault(row["checksum"], row["flight"])
        if original == row["flight"]:
            found = Finding(_DUPLICATE, "pass", "no other log is the same")
        else:
            said = f"is the same log as {original}, which stands for both"
            found = Finding(_DUPLICATE, "fail", said, "Remove one of the two files")
            told = _told([found])
            row |= {"status": "refused"} | {name: told[name] for name in ("reason", "remedy", "advice")}
        row["checks"] += f"; {_compact(found)}"
        row["findings"] = (*row["findings"], found)


def _told(findings: Sequence[Finding]) -> dict[str, Any]:
    """What some findings say, as columns of the table."""
    failures, warnings = of_severity(findings, "fail"), of_severity(findings, "warning")
    return {
        "reason": "; ".join(finding.found for finding in failures),
        "remedy": "; ".join(finding.remedy for finding in failures),
        "warnings": "; ".join(finding.found for finding in warnings),
        "checks": "; ".join(map(_compact, findings)),
        "advice": documents(finding for finding in (*failures, *warnings) if finding.remedy),
        "findings": tuple(findings),
    }


def _compact(finding: Finding) -> str:
    figure = "" if finding.figure is None else f" {finding.figure:.4g}"
    return f"{finding.id} {finding.severity}{figure}"


def of_same_vehicle(flights_table: AnyPath, flights: Iterable[str], newest: str | None) -> list[str]:
    """Flights of the vehicle that flew the newest, in their order; all where that is not known."""
    if newest is None:
        return list(flights)
    rows = {row["flight"]: VehicleIdentity.from_row(row) for row in read_table(flights_table).to_pylist()}
    return [name for name in flights if rows[name].is_same(rows[newest])]
