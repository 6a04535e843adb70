"""Processes that work for this one, and end with it however it ends."""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing.connection import wait
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import Any, ClassVar


def worker_processes(number: int, begin: Callable[..., None] | None = None, *given: Any) -> ProcessPoolExecutor:
    """A pool of processes.

    A pool of the standard library that loses its parent, as when that is killed, waits for work for ever.

    Parameters
    ----------
    begin, given : called in each of them first, with these
    """
    return ProcessPoolExecutor(number, _Spawning(), _begin, (begin, given))


class _SpawnedProcess(SpawnProcess):
    """A spawned process that does not run the caller's script again, whose functions it is not given."""

    def start(self) -> None:
        """Start it; a script need not say `if __name__ == "__main__"` for it."""
        main = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            super().start()
        finally:
            sys.modules["__main__"] = main


class _Spawning(SpawnContext):
    """Makes such processes: one that is forked from a process with threads may wait for ever."""

    Process: ClassVar = _SpawnedProcess


def all_cores() -> int:
    """Cores that this process may use, where nobody says how many processes are to work."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _begin(begin: Callable[..., None] | None, given: tuple[Any, ...]) -> None:
    threading.Thread(target=end_with_parent, daemon=True).start()
    if begin is not None:
        begin(*given)


def end_with_parent() -> None:
    """Wait for the process that started this one to end, and end this one then; for a thread of its own."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        # nothing here is half-written: files appear as a whole
        os._exit(1)
