"""What a long command tells while it runs: lines; on a terminal those about progress replace each other."""

from __future__ import annotations

import shutil
import sys
import textwrap

from fusetune.apply.search.progress import ProgressLine

_WIDEST = 110


class Lines:
    """Prints lines as they come; on a terminal wrapped to its width, progress in one line that is written anew."""

    def __init__(self) -> None:
        self._on_terminal = sys.stdout.isatty()
        self._open = False

    def tell(self, line: str) -> None:
        """Print a line."""
        if not self._on_terminal:
            print(line, flush=True)
            return
        width = shutil.get_terminal_size().columns
        start = "\r\x1b[K" if self._open else ""
        self._open = isinstance(line, ProgressLine)
        if self._open:
            print(f"{start}{textwrap.shorten(line, max(width - 1, 20), placeholder=' …')}", end="", flush=True)
        else:
            print(f"{start}{_wrapped(line, min(width, _WIDEST))}", flush=True)

    def tell_below(self, line: str) -> None:
        """Print a line of a list; on a terminal it goes on a little to the right of where it begins."""
        if not self._on_terminal:
            print(line, flush=True)
            return
        width = max(min(shutil.get_terminal_size().columns, _WIDEST), 20)
        below = " " * (len(line) - len(line.lstrip()) + 2)
        print(textwrap.fill(line, width, subsequent_indent=below, break_long_words=False, break_on_hyphens=False))

    def end(self) -> None:
        """Leave the line about progress as it is: what follows begins a new one."""
        if self._open:
            print(flush=True)
            self._open = False


def _wrapped(line: str, width: int) -> str:
    """A sentence in lines; what is set in columns, behind a space, stays as it is."""
    return line if line.startswith(" ") else textwrap.fill(line, max(width, 20), break_long_words=False)
