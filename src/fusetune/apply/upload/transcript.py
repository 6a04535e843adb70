"""What was said and done, line by line with its time: to the screen what a pilot needs, to a file all of it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import IO

from fusetune.storage.files import AnyPath

Tell = Callable[[str], None]


class Transcript:
    """Lines with the time in UTC; those from before the file was opened are written into it first.

    Parameters
    ----------
    tell : shows a line to the pilot
    """

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._file: IO[str] | None = None
        self._before: list[str] = []

    def keep_in(self, path: AnyPath) -> None:
        """Append to a file from now on."""
        path = Path(path)
        self.close()
        self._file = open(path, "a", encoding="utf-8", errors="backslashreplace")  # noqa: SIM115
        for line in self._before:
            self._file.write(line)
        self._before = []
        self._file.flush()

    def tell(self, text: str) -> None:
        """A line for the pilot and for the file.

        That nobody reads it, or that the disk is full, ends no upload.
        """
        with suppress(OSError):
            self._tell(text)
        for line in text.splitlines():
            self.note(f"| {line}")

    def note(self, text: str) -> None:
        """A line for the file alone."""
        now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3]
        line = f"{now}Z {text}\n"
        if self._file is None:
            self._before.append(line)
        else:
            with suppress(OSError):
                self._file.write(line)
                self._file.flush()

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            with suppress(OSError):
                self._file.close()
            self._file = None
