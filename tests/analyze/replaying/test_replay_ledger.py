"""Which replays a job has to make."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusetune.analyze.replaying.store.ledger import ReplayLedger
from fusetune.analyze.replaying.store.parts import replay_files
from fusetune.storage.documents import read_document, write_document

SETS = {"low": {"EKF2_ACC_NOISE": 0.2}, "high": {"EKF2_ACC_NOISE": 0.9}}


@pytest.fixture
def flight(tmp_path: Path) -> Path:
    folder = tmp_path / "flight"
    folder.mkdir()
    metadata = {"format": 2, "topics": [], "checksum": "of the log"}
    write_document(folder / "metadata.json", metadata)
    return folder


def ledger(flight: Path, made_with: object = "settings") -> ReplayLedger:
    return ReplayLedger(flight, flight.parent, made_with)


def replay(flight: Path) -> None:
    for file in (file for name in SETS for file in replay_files(flight.parent, name)):
        file.write_text(file.name, encoding="utf-8")
    ledger(flight).record(SETS)


def test_all_are_outdated_at_first_and_none_afterwards(flight: Path) -> None:
    assert ledger(flight).outdated(SETS) == SETS
    replay(flight)
    assert ledger(flight).outdated(SETS) == {}


def test_a_new_set_and_one_with_other_values_are_outdated(flight: Path) -> None:
    replay(flight)
    changed = {"low": {"EKF2_ACC_NOISE": 0.3}, "new": {"EKF2_ACC_NOISE": 0.5}}
    assert ledger(flight).outdated(SETS | changed) == changed


def test_sets_that_other_jobs_replayed_are_up_to_date(flight: Path) -> None:
    replay(flight)
    for name, values in SETS.items():
        assert ledger(flight).outdated({name: values, "new": {}}) == {"new": {}}
    ledger(flight).record({})
    assert ledger(flight).outdated(SETS) == {}


def test_other_settings_outdate_all(flight: Path) -> None:
    replay(flight)
    assert ledger(flight, "other settings").outdated(SETS) == SETS


def test_another_log_outdates_all(flight: Path) -> None:
    replay(flight)
    metadata = read_document(flight / "metadata.json")
    write_document(flight / "metadata.json", metadata | {"checksum": "of another"})
    assert ledger(flight).outdated(SETS) == SETS


def test_a_set_that_lacks_one_file_is_outdated(flight: Path) -> None:
    replay(flight)
    replay_files(flight.parent, "high")[2].unlink()
    assert list(ledger(flight).outdated(SETS)) == ["high"]
