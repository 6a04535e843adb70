"""What lies in the folder of flights: entries that cannot be flown, exchanged logs, and what earlier runs left."""

from __future__ import annotations

import csv
import hashlib
import os
import shutil
import sys
from pathlib import Path

import pytest
from tests.workflow.conftest import Workspace

TABLE = "results/save/flights.csv"
LONG_AGO_S = 1_600_000_000


def verdicts(workspace: Workspace) -> dict[str, dict[str, str]]:
    with open(workspace.folder / TABLE, encoding="utf-8-sig", newline="") as file:
        return {row["flight"]: row for row in csv.DictReader(file)}


def sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


@pytest.fixture
def flights(workspace: Workspace) -> Path:
    """The folder of flights, with one file that is no log, which is quickly read."""
    folder = workspace.folder / "flights"
    (folder / "first.ulg").write_bytes(b"no log: first")
    return folder


def test_no_entry_stops_the_others(workspace: Workspace, flights: Path) -> None:
    for session in ("sess001", "sess002"):
        (flights / "log" / session).mkdir(parents=True)
        (flights / "log" / session / "log001.ulg").write_bytes(session.encode())
    # not every file system takes bytes that are no text
    odd = "\udcff.ulg" if sys.platform == "linux" else "\u202e.ulg"
    for name in ("{a}.ulg", "new\nline.ulg", odd, "flights.csv.ulg", "it's <b> & $(id), 100%.ulg"):
        (flights / name).write_bytes(os.fsencode(name))
    (flights / "dangling.ulg").symlink_to("/nowhere/b.ulg")
    os.mkfifo(flights / "pipe.ulg")
    (flights / "folder.ulg").mkdir()
    (flights / "packed.ulg.gz").write_bytes(b"")
    workspace.run_ok("--cores", "2", TABLE)
    rows = verdicts(workspace)
    named = {name for name in rows if not name.startswith("flights.csv_")}
    assert named == {
        *("first", "sess001_log001", "sess002_log001", "_a_", "new_line", "_", "it's _b_ & $(id)_ 100%"),
        *("dangling", "pipe", "folder", "packed.ulg.gz"),
    }
    assert len(rows) == 12
    assert {row["status"] for row in rows.values()} == {"refused"}
    assert all(row["reason"] and row["remedy"] and row["file"] for row in rows.values())
    assert rows["sess002_log001"]["sha256"] == hashlib.sha256(b"sess002").hexdigest()
    assert rows["new_line"]["file"] == "new\\x0aline.ulg"


def test_only_entries_that_cannot_be_flown_are_no_empty_folder(workspace: Workspace, demonstration: Workspace) -> None:
    shutil.copytree(demonstration.folder / "results", workspace.folder / "results")
    (workspace.folder / "flights" / "dangling.ulg").symlink_to("/nowhere/b.ulg")
    printed = workspace.run_ok("--cores", "2")
    assert "1 flights, 1 refused" in printed
    assert "(for each refused log, flights.csv says what it lacks)." in printed.partition("\nNext: ")[2]
    assert verdicts(workspace).keys() == {"dangling"}
    page = (workspace.folder / "results" / "report.html").read_text(encoding="utf-8")
    assert "dangling" in page
    assert "flight_1_low" not in page


def test_a_log_that_is_exchanged_is_another_log(workspace: Workspace, flights: Path) -> None:
    workspace.run_ok("--cores", "1", TABLE)
    other = workspace.folder / "other.ulg"
    other.write_bytes(b"no log: other")
    os.utime(other, (LONG_AGO_S, LONG_AGO_S))
    os.replace(other, flights / "first.ulg")
    assert workspace.planned_jobs(TABLE) == {"save_flight": 1, "list_flights": 1}
    workspace.run_ok("--cores", "1", TABLE)
    assert verdicts(workspace)["first"]["sha256"] == hashlib.sha256(b"no log: other").hexdigest()
    os.utime(flights / "first.ulg")
    assert workspace.planned_jobs(TABLE) == {}


def test_a_vehicle_that_is_exchanged_is_flown_again(workspace: Workspace) -> None:
    plan = "results/design/hop.plan"
    workspace.run_ok("--cores", "1", plan)
    mission = workspace.folder / "config" / "hop.yaml"
    text = mission.read_text(encoding="utf-8")
    mission.write_text(text.replace("speed_m_s: 5.0", "speed_m_s: 4.0", 1), encoding="utf-8")
    os.utime(mission, (LONG_AGO_S, LONG_AGO_S))
    assert workspace.planned_jobs(plan) == {"design": 1}


def test_without_the_memory_of_how_they_were_made_results_are_made_again(workspace: Workspace, flights: Path) -> None:
    workspace.run_ok("--cores", "1", TABLE)
    shutil.rmtree(workspace.folder / ".snakemake")
    (flights / "first.ulg").write_bytes(b"no log: other")
    os.utime(flights / "first.ulg", (LONG_AGO_S, LONG_AGO_S))
    (flights / "second.ulg").write_bytes(b"no log: second")
    assert "Nothing is known of how results/ was made" in workspace.run_ok("--dry-run")
    workspace.run_ok("--cores", "1", TABLE)
    rows = verdicts(workspace)
    assert {name: row["sha256"] for name, row in rows.items()} == {
        name: sha256(flights / f"{name}.ulg") for name in ("first", "second")
    }
