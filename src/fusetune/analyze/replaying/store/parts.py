"""The files that hold one replay: `<set>.<table>.parquet` for each table, and `<set>.json`, which says how it went.

What the tables hold is said in `columns`. Rules of the workflow ask this module, too, so it imports next to nothing.
"""

from __future__ import annotations

from pathlib import Path

from fusetune.storage.files import AnyPath

RECORDED = ("innovations", "states", "local_position", "status_flags")
"""Tables that are written while the replay goes on."""

PREDICTED = ("withheld", "gaps")
"""Tables of what the filter predicted while a sensor was withheld from it; written at the end."""

TABLES = (*RECORDED, *PREDICTED)

PARTS = (*(f"{table}.parquet" for table in TABLES), "json")
"""Ends of the names of all files of a replay."""


def replay_files(folder: AnyPath, set_name: str) -> list[Path]:
    """All files of one replay."""
    return [Path(folder) / f"{set_name}.{part}" for part in PARTS]


def table_file(folder: AnyPath, set_name: str, table: str) -> Path:
    """The file of one of the `TABLES`."""
    return Path(folder) / f"{set_name}.{table}.parquet"


def summary_file(folder: AnyPath, set_name: str) -> Path:
    """The file that says what was replayed and how it went."""
    return Path(folder) / f"{set_name}.json"
