"""Freed memory goes back to the operating system."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from fusetune.storage.freed_memory import give_back_freed_memory


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
    give_back_freed_memory(from_bytes=before + 1)
    assert before - resident_bytes() < 4e6
    give_back_freed_memory(from_bytes=before // 2)
    assert before - resident_bytes() > 40e6
    assert sum(map(len, kept)) == 800 * 8_000
