"""A time by which work on one input has to be done.

Loops over what a file holds ask it as they go, so that no file, however it was made, holds up a run: what takes longer
is given up with a `TimeLimitError`. Nothing is interrupted from outside, so it works in any thread and on any system.
"""

from __future__ import annotations

import math
import time


class TimeLimitError(Exception):
    """The time was not enough."""


class Deadline:
    """So many seconds from its making on.

    Parameters
    ----------
    seconds
        None or 0 for no limit.
    """

    def __init__(self, seconds: float | None = None) -> None:
        self.seconds = seconds or math.inf
        self._end = time.monotonic() + self.seconds

    def check(self) -> None:
        """Go on, if there is time left.

        Raises
        ------
        TimeLimitError
            There is none.
        """
        if time.monotonic() > self._end:
            raise TimeLimitError(f"{self.seconds:g} s were not enough")
