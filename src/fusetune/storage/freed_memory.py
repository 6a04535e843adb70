"""Memory that was freed goes back to the operating system."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa

LARGE_BYTES = 350_000_000
"""A process that analyses a flight of some minutes stays below; to ask for its pages again would only cost time."""


def give_back_freed_memory(from_bytes: int = LARGE_BYTES) -> None:
    """Let the C library return what it keeps of freed arrays between those in use, in a process that is large.

    It returns by itself only what lies at the end of its heap. PyArrow asks for its own memory pool, which is that of
    the C library (`fusetune/__init__.py`), so that this holds for NumPy's arrays, too; where the system knows no such
    thing nothing happens. It takes milliseconds: once a step, not once an array.

    Parameters
    ----------
    from_bytes : resident memory from which on it is worth it
    """
    resident = _resident_bytes()
    if resident is None or resident >= from_bytes:
        pa.default_memory_pool().release_unused()


def _resident_bytes() -> int | None:
    """Memory of this process; None where the system does not tell it as Linux does."""
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
    except OSError:
        return None
    return int(status.partition("VmRSS:")[2].split()[0]) * 1024
