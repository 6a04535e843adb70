"""What every job does around its work: write to its log, be known as at work, tell a user's mistake in one line."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout

from fusetune.errors import UserError
from fusetune.run_lock import join_run


@contextmanager
def logged_job(log: str) -> Iterator[None]:
    """Send what the body prints to `log`; end the process with status 1 where the input is at fault."""
    console = sys.stderr
    with open(log, "w", encoding="utf-8") as file, redirect_stdout(file), redirect_stderr(file):
        join_run(".snakemake")
        try:
            yield
        except UserError as error:
            print(error, file=file)
            print(error, file=console)
            raise SystemExit(1) from None
        except Exception:
            traceback.print_exc(file=file)
            raise


class _Absent:
    """Finds nothing of some packages, as if they were not installed."""

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
