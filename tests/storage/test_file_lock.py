from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from fusetune.storage import file_lock
from fusetune.storage.file_lock import LocksUnavailableError, lock


def test_a_lock_is_for_one_or_for_all_that_share_it(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    with path.open("w+b") as first, path.open("r+b") as second, path.open("r+b") as third:
        assert lock(first, exclusive=False, wait=False)
        assert lock(second, exclusive=False, wait=True)
        assert not lock(third, exclusive=True, wait=False)
        first.close()
        assert not lock(third, exclusive=True, wait=False)
        second.close()
        assert lock(third, exclusive=True, wait=True)


def test_where_the_system_has_no_locks_that_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(file_lock, "fcntl", None)
    monkeypatch.setattr(file_lock, "msvcrt", None)
    with (tmp_path / "lock").open("w+b") as file, pytest.raises(LocksUnavailableError, match="this system has none"):
        lock(file, exclusive=True, wait=False)


class Windows:
    """`msvcrt` where others have locked some bytes; `test_run_lock.py` tries it with several processes."""

    LK_NBLCK = 2

    def __init__(self, taken: range, refusal: int = errno.EACCES) -> None:
        self.taken, self.refusal, self.locked = taken, refusal, list[range]()

    def locking(self, descriptor: int, mode: int, count: int) -> None:
        assert mode == self.LK_NBLCK
        first = os.lseek(descriptor, 0, os.SEEK_CUR)
        wanted = range(first, first + count)
        if set(wanted) & set(self.taken):
            raise OSError(self.refusal, "refused")
        self.locked.append(wanted)


BEHIND = 1 << 30
"""Where no file of ours has content, for on Windows nobody else could read a locked byte."""


@pytest.mark.parametrize(
    ("taken", "exclusive", "got"),
    [
        (range(0), True, range(BEHIND, BEHIND + 1024)),
        (range(0), False, range(BEHIND, BEHIND + 1)),
        (range(BEHIND, BEHIND + 3), False, range(BEHIND + 3, BEHIND + 4)),
        (range(BEHIND, BEHIND + 1023), False, range(BEHIND + 1023, BEHIND + 1024)),
        (range(BEHIND + 3, BEHIND + 4), True, None),
        (range(BEHIND, BEHIND + 1024), False, None),
    ],
)
def test_on_windows_who_shares_takes_one_byte_and_who_wants_it_alone_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, taken: range, exclusive: bool, got: range | None
) -> None:
    windows = Windows(taken)
    monkeypatch.setattr(file_lock, "fcntl", None)
    monkeypatch.setattr(file_lock, "msvcrt", windows)
    with (tmp_path / "lock").open("w+b") as file:
        file.write(b"who")
        assert lock(file, exclusive, wait=False) == (got is not None)
        assert file.tell() == 3
    assert windows.locked == ([] if got is None else [got])


@pytest.mark.parametrize("exclusive", [True, False])
def test_on_windows_a_file_system_without_locks_is_told_from_a_lock_that_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, exclusive: bool
) -> None:
    monkeypatch.setattr(file_lock, "fcntl", None)
    monkeypatch.setattr(file_lock, "msvcrt", Windows(range(BEHIND, BEHIND + 1), errno.EINVAL))
    with (tmp_path / "lock").open("w+b") as file, pytest.raises(LocksUnavailableError, match="refused"):
        lock(file, exclusive, wait=False)
