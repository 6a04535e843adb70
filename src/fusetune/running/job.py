"""What every job does around its work: log, be known as at work, tell a user's mistake in one line, what it cost."""

from __future__ import annotations

import signal
import sys
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from pathlib import Path

from fusetune.errors import UserError, write_error
from fusetune.running.run_lock import join_run

try:
    import resource
except ImportError:  # as on Windows
    resource = None  # type: ignore[assignment]

LOGS, COSTS = "logs", "benchmarks"
"""Folders below that of the results."""


@contextmanager
def logged_job(log: str) -> Iterator[None]:
    """Send what the body prints to `log`; end the process with status 1 where the input or the disk is at fault."""
    failure: Exception | None = None
    begin = time.perf_counter()
    try:
        with (
            open(log, "w", encoding="utf-8", errors="backslashreplace") as file,
            redirect_stdout(file),
            redirect_stderr(file),
        ):
            join_run(".snakemake")
            try:
                yield
            except Exception as error:
                failure = error
                print(_fault_of_the_user(error) or traceback.format_exc())
                raise
        _write_cost(Path(log), time.perf_counter() - begin)
    except KeyboardInterrupt:
        raise SystemExit(128 + signal.SIGINT) from None
    except Exception as error:
        # where the disk is full, closing the log fails, too; what the job itself failed by is what counts
        fault = _fault_of_the_user(failure or error)
        if fault is None:
            raise
        print(fault, file=sys.stderr)
        raise SystemExit(1) from None


def _write_cost(log: Path, wall_s: float) -> None:
    """Write what a job took, as Snakemake's `benchmark` would, had the job no parent that was there before it."""
    results = next((folder for folder in log.parents if folder.name == LOGS), log).parent
    if resource is None or results == log.parent:
        return
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    cpu_s = sum(one.ru_utime + one.ru_stime for one in used)
    rss_mb = max(one.ru_maxrss for one in used) / (1 << 20 if sys.platform == "darwin" else 1 << 10)
    file = results / COSTS / log.relative_to(results / LOGS).with_suffix(".tsv")
    with suppress(OSError):  # nothing rests on it
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"s\tmax_rss\tcpu_time\n{wall_s:.4f}\t{rss_mb:.2f}\t{cpu_s:.4f}\n", encoding="ascii")


def _fault_of_the_user(error: Exception) -> UserError | None:
    """What is to be told in one line; `None` for what is a fault of ours."""
    if isinstance(error, OSError):
        return write_error(error, "results")
    return error if isinstance(error, UserError) else None


class _Absent:
    """Finds nothing of some packages, as if they were not installed.

    A finder is how Python lets a program say so. `None` in `sys.modules` would be shorter, but Cython takes that for
    the module itself, and PyArrow is written in it.
    """

    def __init__(self, packages: tuple[str, ...]) -> None:
        self.packages = packages

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        """Refuse the packages; leave all else to the other finders."""
        if name.partition(".")[0] in self.packages:
            raise ModuleNotFoundError(f"{name} is kept out of this process", name=name)


def keep_out(*packages: str) -> None:
    """Spare a job the import of packages that others load only to look whether they are there.

    PyArrow does so with pandas, to see whether it is given a Series, and Numba with SciPy, for linear algebra that no
    kernel uses; each takes some 0.4 s.
    """
    sys.meta_path.insert(0, _Absent(packages))  # type: ignore[arg-type]
