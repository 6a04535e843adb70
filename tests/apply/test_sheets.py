"""The tables for spreadsheets: what they say they hold, and that a spreadsheet's reader and pandas find it there."""

from __future__ import annotations

import csv
from datetime import UTC, datetime
from pathlib import Path

import pandas as pd
import pyarrow as pa
from tests.apply.test_decide import QUIET, MadeSet, run
from tests.made_text import UpToDate

from fusetune.apply.ranking_sheet import ranking_sheet
from fusetune.finding import Finding, documents
from fusetune.save.flights_sheet import CHECKS_SHEET, FLIGHTS_SHEET
from fusetune.save.flights_table import write_flights_table
from fusetune.storage.csv_file import write_csv
from fusetune.storage.documents import write_document
from fusetune.storage.parquet import read_table
from fusetune.storage.sheet import columns_in_words, table_row

LOG = {
    "file": "sess°/=1+1.ulg",
    "recorded": "2025-06-15T10:00:01Z",
    "duration_s": 12.5,
    "checksum": "ab",
    "size_bytes": 7,
    "vehicle": "@x",
}


def read(file: Path) -> list[dict[str, str]]:
    with open(file, encoding="utf-8-sig", newline="") as opened:
        return list(csv.DictReader(opened))


def test_the_columns_of_the_sheets_are_documented(project_root: Path, up_to_date: UpToDate) -> None:
    sheets = {"flights": FLIGHTS_SHEET, "checks": CHECKS_SHEET, "ranking": ranking_sheet("gnss_vel")}
    for name, columns in sheets.items():
        up_to_date(project_root / "docs" / "sheets.md", name, columns_in_words(columns))
        assert len({column.name for column in columns}) == len(columns)
        assert not any(character in column.name for column in columns for character in " =+-@[](),;²")


def test_flights_and_their_checks_are_read_as_they_were_found(tmp_path: Path) -> None:
    findings = [
        Finding("imu_rate", "pass", "the IMU has 250 Hz", figure=250.0, threshold=100.0, unit="Hz"),
        Finding("gnss", "warning", "GNSS has gaps", "-Look at the antenna", 2.5, 1.0, "s", 1_500_000, 4_000_000),
    ]
    folder = tmp_path / "odd"
    folder.mkdir()
    write_document(folder / "verdict.json", {"flight": "odd", "status": "replayable", "findings": documents(findings)})
    write_document(folder / "metadata.json", LOG)
    flights, checks = tmp_path / "flights.csv", tmp_path / "checks.csv"
    write_flights_table([folder], tmp_path / "flights.parquet", flights, checks=checks)
    (row,) = read(flights)
    assert list(row) == [column.name for column in FLIGHTS_SHEET]
    assert (row["file"], row["vehicle"]) == ("sess°/=1+1.ulg", "'@x")
    assert (row["failed_checks"], row["warning_checks"], row["airborne_s"]) == ("0", "1", "")
    recorded = datetime.strptime(row["recorded_utc"], "%Y-%m-%dT%H:%M:%S%z")
    assert recorded == datetime(2025, 6, 15, 10, 0, 1, tzinfo=UTC)
    assert table_row(FLIGHTS_SHEET, row)["checksum"] == "ab"
    table = pd.read_csv(checks)
    assert list(table) == [column.name for column in CHECKS_SHEET]
    assert list(table["check"]) == ["imu_rate", "gnss", "duplicate"]
    assert table.loc[1, ["figure", "threshold", "unit", "from_boot_s", "to_boot_s"]].tolist() == [2.5, 1, "s", 1.5, 4]
    assert table.loc[1, "remedy"] == "'-Look at the antenna"
    assert table["from_boot_s"].isna().tolist() == [True, False, True]
    assert pd.read_csv(flights)["flight"].tolist() == ["odd"]


def test_the_ranking_is_that_of_the_table_in_numbers_and_single_facts(tmp_path: Path) -> None:
    run(tmp_path, {"present": MadeSet(error=0.13), "better": MadeSet(error=0.1, overrides=QUIET)})
    folder = tmp_path / "apply"
    sheet, table = pd.read_csv(folder / "ranking.csv"), read_table(folder / "ranking.parquet").to_pandas()
    columns = ranking_sheet("gnss_vel")
    assert list(sheet) == [column.name for column in columns]
    assert sheet["set"].tolist() == table["name"].tolist() == ["better", "present"]
    for column in columns:
        if column.source in table and pd.api.types.is_float_dtype(table[column.source]):
            pd.testing.assert_series_equal(
                sheet[column.name].astype(float), table[column.source], check_names=False, rtol=1e-9
            )
    assert sheet["error_change_percent"][0] == -table["improvement_percent"][0] < 0
    assert not sheet[["worse_aided", "worse_unaided", "worse_smoothed"]].to_numpy().any()
    # all of the table is in the sheet, lists as columns of their own
    assert {*table} - {column.source for column in columns} == {"improvement_percent", "worse_aims"}


def test_what_is_not_known_is_an_empty_cell(tmp_path: Path) -> None:
    write_csv(tmp_path / "table.csv", pa.table({"a_m": [float("nan"), 1.0, None], "b": ["nan", "", "x"]}))
    assert (tmp_path / "table.csv").read_bytes() == b'\xef\xbb\xbf"a_m","b"\n,"nan"\n1,""\n,"x"\n'
