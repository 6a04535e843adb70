"""One table of all flights with their verdicts."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa

from fusetune.save.discovery import RefusedEntry
from fusetune.save.flight_folder import METADATA_FILE, read_flight_document
from fusetune.save.log_folder import VERDICT_FILE
from fusetune.storage.checksum_file import write_checksum
from fusetune.storage.csv_file import write_csv
from fusetune.storage.files import atomic_path
from fusetune.storage.parquet import write_table

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
        ("hardware", pa.string()),
        ("recorded", pa.string()),
        ("duration_s", pa.float64()),
        ("airborne_s", pa.float64()),
        ("checksum", pa.string()),
        ("size_bytes", pa.int64()),
        ("advice", pa.list_(pa.struct([(name, pa.string()) for name in ("check", "reason", "remedy")]))),
    ]
)
"""Columns of the table: `status` is replayable or refused, `reason` says why a flight is refused.

`file` is the path of the log below the folder of flights.
`checks` holds name, status and figure of every check; `advice`, which the CSV leaves out, the remedies of those that
did not pass.
"""

_DUPLICATE = "duplicate"


def write_flights_table(
    folders: Sequence[str | os.PathLike[str]],
    table: str | os.PathLike[str],
    csv: str | os.PathLike[str],
    refused: Sequence[RefusedEntry] = (),
) -> list[dict[str, Any]]:
    """Put the verdicts of saved flights into one table, in the order given, as Parquet and as CSV.

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
    rows = pa.Table.from_pylist(found, schema=SCHEMA)
    with atomic_path(table) as temporary:
        write_table(rows, temporary)
    write_csv(csv, rows.drop_columns(["advice"]))
    write_checksum(csv)
    return found


def _row(folder: Path) -> dict[str, Any]:
    verdict, metadata = (read_flight_document(folder / name) for name in (VERDICT_FILE, METADATA_FILE))
    failed = [check for check in verdict["checks"] if check["status"] == "fail"]
    warned = [check for check in verdict["checks"] if check["status"] == "warning"]
    return {
        "flight": verdict["flight"],
        "file": metadata["file"],
        "status": verdict["status"],
        "reason": "; ".join(check["reason"] for check in failed),
        "remedy": "; ".join(check["remedy"] for check in failed),
        "warnings": "; ".join(check["reason"] for check in warned),
        "checks": "; ".join(_compact(check) for check in verdict["checks"]),
        "firmware": metadata.get("firmware", "unknown"),
        "hardware": str(metadata.get("hardware", {}).get("ver_hw", "")),
        "recorded": metadata.get("recorded", ""),
        "duration_s": metadata.get("duration_s"),
        "airborne_s": metadata.get("airborne_s"),
        "checksum": metadata["checksum"],
        "size_bytes": metadata["size_bytes"],
        "advice": [
            {"check": check["name"], "reason": check["reason"], "remedy": check["remedy"]}
            for check in (*failed, *warned)
            if check["remedy"]
        ],
    }


def _row_of_refused(entry: RefusedEntry) -> dict[str, Any]:
    check = {"check": "readable", "reason": entry.reason, "remedy": entry.remedy}
    texts = dict.fromkeys(("warnings", "hardware", "recorded", "checksum"), "")
    return texts | {
        "flight": entry.flight,
        "file": entry.shown,
        "status": "refused",
        "reason": entry.reason,
        "remedy": entry.remedy,
        "checks": "readable fail",
        "firmware": "unknown",
        "size_bytes": 0,
        "advice": [check],
    }


def _refuse_duplicates(rows: list[dict[str, Any]]) -> None:
    first: dict[str, str] = {}
    for row in sorted(rows, key=lambda row: str(row["flight"])):
        if row["status"] != "replayable":
            continue
        original = first.setdefault(row["checksum"], row["flight"])
        status = "pass" if original == row["flight"] else "fail"
        row["checks"] += f"; {_DUPLICATE} {status}"
        if status == "fail":
            row["status"] = "refused"
            row["reason"] = f"is the same log as {original}, which stands for both"
            row["remedy"] = "Remove one of the two files"
            row["advice"] = [{"check": _DUPLICATE, "reason": row["reason"], "remedy": row["remedy"]}]


def _compact(check: dict[str, Any]) -> str:
    figure = "" if check["figure"] is None else f" {check['figure']:.4g}"
    return f"{check['name']} {check['status']}{figure}"
