"""Runs the workflow in a folder: Snakemake as a process of this interpreter, whose events are told as they come.

Snakemake has a group of processes of its own, so that whoever interrupts this process interrupts Snakemake and its jobs
once, and by this process alone.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from fusetune.running.workflow_events import Event, event_of
from fusetune.storage.files import AnyPath

Teller = Callable[[Event | str], None]
"""Takes events, and lines that jobs or the workflow print themselves."""


def run_workflow(snakefile: AnyPath, folder: AnyPath, arguments: Sequence[str], told: Teller) -> int:
    """Run Snakemake in a folder and wait for its end.

    Parameters
    ----------
    snakefile : of the workflow
    folder : that it works in; takes `results/`
    arguments : Snakemake's, such as `--cores 2`
    told : is told what happens, as it happens

    Returns
    -------
    Snakemake's exit status: 0 where all that was asked for is there

    Raises
    ------
    KeyboardInterrupt
        This process was interrupted; Snakemake and its jobs have ended.
    """
    # -P: the folder is the user's, and what lies there is no module
    command = [
        sys.executable,
        "-P",
        "-m",
        "snakemake",
        "--snakefile",
        os.path.abspath(snakefile),
        "--logger",
        "fusetune",
    ]
    with _asked_to_end_as_interrupted():
        process = subprocess.Popen(
            [*command, *arguments],
            cwd=Path(folder),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            encoding="utf-8",
            errors="backslashreplace",
            process_group=0 if os.name == "posix" else None,
        )
        try:
            _tell_all(process, told)
            return process.wait()
        except BaseException:
            _end(process)
            raise


def _tell_all(process: subprocess.Popen[str], told: Teller) -> None:
    assert process.stdout is not None
    for line in process.stdout:
        told(event_of(line) or line.rstrip("\n"))


def _end(process: subprocess.Popen[str]) -> None:
    """Interrupt, and wait; who is impatient and interrupts again ends all at once."""
    try:
        _signal(process, signal.SIGINT)
        # a full pipe would keep it from ending
        _tell_all(process, lambda line: None)
        process.wait()
    except BaseException:
        _signal(process, getattr(signal, "SIGKILL", signal.SIGTERM))
        process.wait()


def _signal(process: subprocess.Popen[str], number: int) -> None:
    if process.poll() is None:
        if os.name == "posix":
            os.killpg(process.pid, number)
        else:
            process.terminate()


@contextmanager
def _asked_to_end_as_interrupted() -> Iterator[None]:
    """Let a terminal that closes, or whoever ends this process, end Snakemake as Ctrl-C does."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    names = [name for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    former = {}
    try:
        for number in (getattr(signal, name) for name in names):
            if signal.getsignal(number) is signal.SIG_DFL:
                former[number] = signal.signal(number, interrupt)
        yield
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)
