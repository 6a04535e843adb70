"""Processes that work for this one, and end with it however it ends."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing.connection import wait
from typing import Any


def worker_processes(number: int, begin: Callable[..., None] | None = None, *given: Any) -> ProcessPoolExecutor:
    """A pool of processes.

    A pool of the standard library that loses its parent, as when that is killed, waits for work for ever.

    Parameters
    ----------
    begin, given : called in each of them first, with these
    """
    # a process that is forked from one with threads may wait for ever
    return ProcessPoolExecutor(number, multiprocessing.get_context("spawn"), _begin, (begin, given))


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
