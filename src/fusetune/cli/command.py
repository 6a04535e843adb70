"""What a sub-command is, and how it may end."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Protocol

DONE = 0
"""All is done."""

REFUSED = 1
"""All that could be done is: at least one log was refused, and the lines printed say why and what to do about it."""

FOUND_FAILURE = 3
"""A diagnosis found what nobody should fly with."""

USER_ERROR = 2
"""Nothing more could be done, because of the command line or a file: one line says what to do."""

INTERRUPTED = 130
"""Ctrl-C."""

NO_READER = 141
"""Who read the output has gone."""


class Command(Protocol):
    """A module of this folder, named like its sub-command; it imports the rooms that it needs when it runs.

    Attributes
    ----------
    HELP : what it does, in a line
    EXAMPLES : command lines, each with what it is for
    """

    HELP: str

    @property
    def EXAMPLES(self) -> Sequence[tuple[str, str]]:
        """They are read only."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Say what it takes."""

    def run(self, options: argparse.Namespace) -> int:
        """Do it.

        Returns
        -------
        int
            `DONE` or `REFUSED`; of `diagnose` as it says

        Raises
        ------
        UserError
            The command line or a file cannot be used.
        """
