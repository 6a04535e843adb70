from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.storage.ledger import Ledger, key_of


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    made = [tmp_path / "low.json", tmp_path / "low.states.parquet"]
    for file in made:
        file.write_text("made")
    return made


def test_what_was_recorded_is_current_in_the_next_process(tmp_path: Path, files: list[Path]) -> None:
    Ledger(tmp_path / "ledger.json").record("low", "key", files)
    assert Ledger(tmp_path / "ledger.json").is_current("low", "key", files)


def test_other_inputs_other_files_and_unknown_entries_are_not_current(tmp_path: Path, files: list[Path]) -> None:
    ledger = Ledger(tmp_path / "ledger.json")
    ledger.record("low", "key", files)
    assert not ledger.is_current("low", "other key", files)
    assert not ledger.is_current("low", "key", files[:1])
    assert not ledger.is_current("high", "key", files)


def test_a_file_that_was_changed_or_removed_is_not_current(tmp_path: Path, files: list[Path]) -> None:
    ledger = Ledger(tmp_path / "ledger.json")
    ledger.record("low", "key", files)
    files[0].write_text("harm")
    assert not ledger.is_current("low", "key", files)
    ledger.record("low", "key", files)
    files[1].unlink()
    assert not ledger.is_current("low", "key", files)


def test_a_new_time_stamp_alone_changes_nothing(tmp_path: Path, files: list[Path]) -> None:
    ledger = Ledger(tmp_path / "ledger.json")
    ledger.record("low", "key", files)
    os.utime(files[0], ns=(0, 0))
    assert ledger.is_current("low", "key", files)


@pytest.mark.parametrize("content", ["", "{", "[]", '{"low": 3}', "\x00"])
def test_a_damaged_ledger_counts_as_empty(tmp_path: Path, files: list[Path], content: str) -> None:
    (tmp_path / "ledger.json").write_text(content)
    ledger = Ledger(tmp_path / "ledger.json")
    assert not ledger.is_current("low", "key", files)
    ledger.record("low", "key", files)
    assert ledger.is_current("low", "key", files)


@given(st.dictionaries(st.text(), st.floats(allow_nan=False)))
def test_a_key_does_not_depend_on_the_order_of_a_mapping(values: dict[str, float]) -> None:
    assert key_of(values) == key_of(dict(reversed(values.items())))


def test_a_key_depends_on_every_value() -> None:
    assert len({key_of(entry) for entry in ({"a": 1.0}, {"a": 1.5}, {"b": 1.0}, [{"a": 1.0}], {})}) == 5
