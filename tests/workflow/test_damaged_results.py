"""Damaged files of results are told by name, and doing what the messages say leads back to the same results."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import pytest
from benchmarks.flipped_bits import SILENT, flip
from tests.workflow.conftest import Workspace

MESSAGE = re.compile(r"(results/\S+): is damaged.*Delete (?:it|the whole folder (\S+)) and run the pipeline")
MOST_RUNS = 8


@pytest.fixture
def finished(demonstration: Workspace, tmp_path: Path) -> Workspace:
    """A copy of the finished demonstration, with the time stamps by which Snakemake sees what is current."""
    shutil.copytree(demonstration.folder, tmp_path / "work")
    return Workspace(tmp_path / "work")


def flip_one_bit(file: Path) -> None:
    """As a disk does it: the time stamp stays."""
    stamp, content = file.stat(), bytearray(file.read_bytes())
    content[len(content) // 3] ^= 4
    file.write_bytes(content)
    os.utime(file, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))


def test_no_flipped_bit_of_the_demonstration_is_silent(demonstration: Workspace) -> None:
    outcomes = flip(demonstration.folder / "results", 300, seed=1)
    assert len(outcomes) == 4
    assert sum(sum(counts.values()) for counts in outcomes.values()) == 300
    assert [kind for kind, counts in outcomes.items() if counts[SILENT]] == []


def test_deleting_what_the_messages_name_leads_back_to_the_same_results(
    finished: Workspace, demonstration: Workspace
) -> None:
    results = finished.folder / "results"
    harmed = {
        "results/save/flights.csv",
        "results/save/flight_1_low/vehicle_air_data_0.parquet",
        "results/execute/flight_1_low.ulg",
        "results/analyze/flight_2_high/scores.parquet",
    }
    for name in harmed:
        flip_one_bit(finished.folder / name)
    # so that one flight is replayed again, and a decision made
    (results / "analyze" / "flight_1_low" / "present.json").unlink()
    (results / "apply" / "ranking.csv").unlink()
    told = set()
    for _ in range(MOST_RUNS):
        run = finished.run("--cores", "2", "--keep-going")
        assert "Traceback (most recent call last)" not in run.stdout
        if run.returncode == 0:
            break
        messages = MESSAGE.findall(run.stdout)
        assert messages, run.stdout
        for file, folder in messages:
            told.add(file)
            if folder:
                shutil.rmtree(finished.folder / folder, ignore_errors=True)
            else:
                (finished.folder / file).unlink(missing_ok=True)
    assert run.returncode == 0, run.stdout
    assert told == harmed
    assert finished.planned_jobs() == {}
    ours, untouched = finished.results(), demonstration.results()
    assert ours.keys() == untouched.keys()
    assert [name for name in ours if ours[name] != untouched[name]] == []
