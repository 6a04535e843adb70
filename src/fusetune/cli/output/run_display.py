"""What `fusetune run` shows while it works: a bar on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from fusetune.running.run_progress import RunProgress
from fusetune.running.workflow_events import Event, JobBegun, JobDone, JobFailed, Told

if TYPE_CHECKING:
    from rich.console import RenderableType

EVERY_S = 15.0
"""Where nothing is drawn, a line tells of the progress no more often."""

MOST_JOBS_SHOWN = 3


class RunDisplay(Protocol):
    """Takes what happens, and shows it on standard error."""

    def take(self, told: Event | str) -> None:
        """Know of an event, or of a line that something printed."""

    def end(self) -> None:
        """Leave the terminal as it was."""


def run_display(*, quiet: bool, verbose: bool) -> RunDisplay:
    """The one that suits: where standard error is no terminal nothing is drawn."""
    if quiet:
        return _Nothing()
    if verbose:
        return _AllLines()
    return _Bar() if sys.stderr.isatty() else _FewLines()


class _Nothing:
    def take(self, told: Event | str) -> None:
        return

    def end(self) -> None:
        return


class _AllLines(_Nothing):
    """Every job as it begins and ends, and what Snakemake and the jobs say."""

    def __init__(self) -> None:
        self._progress = RunProgress()
        self._begun: dict[int, float] = {}

    def take(self, told: Event | str) -> None:
        if isinstance(told, str):
            _print(told)
            return
        job = self._progress.now.get(told.number) if isinstance(told, JobDone | JobFailed) else None
        self._progress.take(told)
        if isinstance(told, JobBegun):
            self._begun[told.number] = time.monotonic()
            _print(told.words)
        elif job is not None:
            took_s = time.monotonic() - self._begun.pop(job.number)
            _print(f"{job.words}: {'done' if isinstance(told, JobDone) else 'failed'} after {took_s:.1f} s")
        elif isinstance(told, Told):
            _print(told.text)


class _FewLines(_Nothing):
    """A line when there is something to do, one now and then, and none at the end."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._progress, self._clock = RunProgress(clock), clock
        self._last = clock()

    def take(self, told: Event | str) -> None:
        if isinstance(told, str):
            _tell_of_waiting(told)
            return
        self._progress.take(told)
        if isinstance(told, JobBegun) and self._clock() - self._last >= EVERY_S:
            self._last = self._clock()
            _print(f"{told.words} ({', '.join(_figures(self._progress))})")


class _Bar:
    """A bar, what is being done, flights done, time left; gone at the end."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.live import Live

        self._progress = RunProgress()
        self._live = Live(
            get_renderable=self._drawn,
            console=Console(stderr=True, highlight=False),
            refresh_per_second=5,
            transient=True,
            redirect_stdout=False,
        )
        self._live.start()

    def take(self, told: Event | str) -> None:
        if isinstance(told, str):
            _tell_of_waiting(told)
        else:
            self._progress.take(told)

    def end(self) -> None:
        self._live.stop()

    def _drawn(self) -> RenderableType:
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        progress = self._progress
        row = Table.grid(padding=(0, 2))
        bar = ProgressBar(total=1.0, completed=progress.share, width=30, complete_style="cyan", finished_style="cyan")
        row.add_row(
            bar, Text(f"{100.0 * progress.share:3.0f} %", no_wrap=True), Text(", ".join(_figures(progress)[1:]))
        )
        lines = _at_work(progress)
        return Group(row, *(Text(line, style="dim", no_wrap=True, overflow="ellipsis") for line in lines))


def _at_work(progress: RunProgress) -> list[str]:
    """What is being done, a line for each of a few jobs."""
    if not progress.total:
        return ["Look for what there is to do"]
    words = [job.words for job in progress.now.values()]
    more = len(words) - MOST_JOBS_SHOWN
    return [*words[:MOST_JOBS_SHOWN], f"and {more} more"] if more > 0 else words


def _figures(progress: RunProgress) -> list[str]:
    """How far it is, in words, the share first."""
    told = [f"{100.0 * progress.share:.0f} %"]
    if progress.flights:
        told.append(f"{progress.flights_done} of {progress.flights} flights")
    if progress.left_s is not None:
        told.append(f"{_time(progress.left_s)} left")
    return told


def _time(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def _tell_of_waiting(line: str) -> None:
    """Of lines that something printed while it worked, what makes its reader wait; the rest is told at the end."""
    if line.endswith("..."):
        _print(line)


def _print(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
