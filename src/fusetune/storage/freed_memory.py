"""Memory that was freed goes back to the operating system."""

from __future__ import annotations

import pyarrow as pa


def give_back_freed_memory() -> None:
    """Let the C library return what it keeps of freed arrays between those in use.

    It returns by itself only what lies at the end of its heap. PyArrow asks for its own memory pool, which is that of
    the C library (`fusetune/__init__.py`), so that this holds for NumPy's arrays, too; where the system knows no such
    thing nothing happens. It takes milliseconds: once a step, not once an array.
    """
    pa.default_memory_pool().release_unused()
