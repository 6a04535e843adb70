"""Freed memory goes back to the operating system."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from fusetune.storage import freed_memory
from fusetune.storage.freed_memory import LARGE_BYTES, give_back_freed_memory


def resident_bytes() -> int:
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.partition("VmRSS:")[2].split()[0]) * 1024


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc; other systems return memory in their own way")
def test_memory_between_arrays_in_use_is_returned() -> None:
    arrays = [np.ones(8_000) for _ in range(1_600)]
    # every second one holds those before it back: the heap's end stays in use
    kept = arrays[1::2]
    before = resident_bytes()
    del arrays
    give_back_freed_memory(from_bytes=0)
    assert before - resident_bytes() > 40e6
    assert sum(map(len, kept)) == 800 * 8_000


@pytest.mark.parametrize(("resident", "asked"), [(LARGE_BYTES - 1, 0), (LARGE_BYTES, 1), (None, 1)])
def test_only_a_large_process_is_asked(monkeypatch: pytest.MonkeyPatch, resident: int | None, asked: int) -> None:
    calls: list[None] = []
    monkeypatch.setattr(freed_memory, "_resident_bytes", lambda: resident)
    monkeypatch.setattr(freed_memory.pa, "default_memory_pool", lambda: Pool(calls))
    give_back_freed_memory()
    assert len(calls) == asked


class Pool:
    def __init__(self, calls: list[None]) -> None:
        self.calls = calls

    def release_unused(self) -> None:
        self.calls.append(None)
