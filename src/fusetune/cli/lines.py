"""What a long command tells while it runs: lines; on a terminal those about progress replace each other."""

from __future__ import annotations

import shutil
import sys
import textwrap
from typing import TextIO

from fusetune.apply.search.progress import ProgressLine

_WIDEST = 110


class Lines:
    """Prints lines as they come; on a terminal wrapped to its width, progress in one line that is written anew.

    Parameters
    ----------
    stream : where to; by default standard output
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stdout
        self._on_terminal = self._stream.isatty()
        self._open = False

    def tell(self, line: str) -> None:
        """Print a line."""
        if not self._on_terminal:
            print(line, file=self._stream, flush=True)
            return
        width = shutil.get_terminal_size().columns
        start = "\r\x1b[K" if self._open else ""
        self._open = isinstance(line, ProgressLine)
        if self._open:
            print(
                f"{start}{textwrap.shorten(line, max(width - 1, 20), placeholder=' …')}",
                end="",
                file=self._stream,
                flush=True,
            )
        else:
            print(f"{start}{_wrapped(line, min(width, _WIDEST))}", file=self._stream, flush=True)

    def tell_below(self, line: str) -> None:
        """Print a line of a list; on a terminal it goes on a little to the right of where it begins."""
        if not self._on_terminal:
            print(line, file=self._stream, flush=True)
            return
        width = max(min(shutil.get_terminal_size().columns, _WIDEST), 20)
        below = " " * (len(line) - len(line.lstrip()) + 2)
        told = textwrap.fill(line, width, subsequent_indent=below, break_long_words=False, break_on_hyphens=False)
        print(told, file=self._stream)

    def end(self) -> None:
        """Leave the line about progress as it is: what follows begins a new one."""
        if self._open:
            print(file=self._stream, flush=True)
            self._open = False


def _wrapped(line: str, width: int) -> str:
    """A sentence in lines; what is set in columns, behind a space, stays as it is."""
    return line if line.startswith(" ") else textwrap.fill(line, max(width, 20), break_long_words=False)
