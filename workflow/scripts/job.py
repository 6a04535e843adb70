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


class _PandasAbsent:
    """Finds no pandas, as if it were not installed."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> None:
        """Refuse pandas; leave all else to the other finders."""
        if name == "pandas":
            raise ModuleNotFoundError(f"{name} is kept out of this process", name=name)


def keep_pandas_out() -> None:
    """Spare a job the import of pandas, some 0.4 s, which pyarrow loads only to look whether it is given a Series."""
    sys.meta_path.insert(0, _PandasAbsent)  # type: ignore[arg-type]
