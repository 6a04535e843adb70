from __future__ import annotations

import hashlib
import os
import time
from pathlib import Path

import pytest

from fusetune.storage import content
from fusetune.storage.content import ContentDigests

LONG_AGO_NS = 1_500_000_000_000_000_000


@pytest.fixture
def settled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Files count as settled at once, whatever the clock says."""
    monkeypatch.setattr(content, "SETTLED_NS", -(10**18))


def sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def test_a_digest_is_that_of_the_bytes_and_stays_for_one_process(tmp_path: Path) -> None:
    file = tmp_path / "a.ulg"
    file.write_bytes(b"one")
    digests = ContentDigests(tmp_path / "cache.json")
    assert digests.of(file) == sha256(b"one")
    file.write_bytes(b"two")
    assert digests.of(file) == sha256(b"one")
    assert not (tmp_path / "cache.json").exists()


@pytest.mark.usefixtures("settled")
def test_a_file_that_stays_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, cache = tmp_path / "a.ulg", tmp_path / "cache.json"
    file.write_bytes(b"one")
    first = ContentDigests(cache)
    first.of(file)
    first.save()
    monkeypatch.setattr(content.hashlib, "file_digest", lambda *_: pytest.fail("was read again"))
    again = ContentDigests(cache)
    assert again.of(file) == sha256(b"one")
    again.save()
    assert ContentDigests(cache).of(file) == sha256(b"one")


@pytest.mark.usefixtures("settled")
def test_a_file_exchanged_for_an_older_one_of_equal_size_is_noticed(tmp_path: Path) -> None:
    file, other, cache = tmp_path / "a.ulg", tmp_path / "b.ulg", tmp_path / "cache.json"
    file.write_bytes(b"one")
    other.write_bytes(b"two")
    for each in (file, other):
        os.utime(each, ns=(LONG_AGO_NS, LONG_AGO_NS))
    first = ContentDigests(cache)
    assert first.of(file) == sha256(b"one")
    first.save()
    os.replace(other, file)  # as mv does: the time stamp is the same, the size is the same
    assert ContentDigests(cache).of(file) == sha256(b"two")
    file.write_bytes(b"six")
    os.utime(file, ns=(LONG_AGO_NS, LONG_AGO_NS))  # as cp -p does
    assert ContentDigests(cache).of(file) == sha256(b"six")


def test_a_file_that_has_just_changed_is_not_remembered(tmp_path: Path) -> None:
    file, cache = tmp_path / "a.ulg", tmp_path / "cache.json"
    file.write_bytes(b"one")
    digests = ContentDigests(cache)
    digests.of(file)
    digests.save()
    assert not cache.exists()
    assert time.time_ns() - file.stat().st_mtime_ns < content.SETTLED_NS


def test_files_that_change_after_they_were_asked_for_are_known(tmp_path: Path) -> None:
    for name in ("stays", "grows", "goes", "comes"):
        (tmp_path / name).write_bytes(b"one")
    (tmp_path / "comes").unlink()
    digests = ContentDigests(tmp_path / "cache.json")
    for name in ("stays", "grows", "goes", "comes"):
        digests.of(tmp_path / name)
    assert digests.changed() == []
    (tmp_path / "grows").write_bytes(b"more")
    (tmp_path / "goes").unlink()
    (tmp_path / "comes").write_bytes(b"one")
    assert [Path(name).name for name in digests.changed()] == ["grows", "goes", "comes"]


def test_what_cannot_be_read_differs_from_what_can(tmp_path: Path) -> None:
    assert ContentDigests(tmp_path / "cache.json").of(tmp_path / "absent") == (
        "cannot be read (No such file or directory)"
    )


@pytest.mark.parametrize("text", ["", "[]", "{", '{"a": 1}', '{"a": [[1], 2]}', '{"a": null}'])
def test_a_broken_cache_counts_as_empty(tmp_path: Path, text: str) -> None:
    (tmp_path / "cache.json").write_text(text, encoding="ascii")
    (tmp_path / "a").write_bytes(b"one")
    assert ContentDigests(tmp_path / "cache.json").of(tmp_path / "a") == sha256(b"one")
