"""The error that is meant for the user: what is wrong with which file, and what to do about it."""

from __future__ import annotations

import os

RUN_AGAIN = "Delete it and run the pipeline again"
"""What mends a damaged file of results."""
FOLDER_AGAIN = "Delete the whole folder {folder} and run the pipeline again"
"""What mends a file in the folder of a saved flight: the pipeline knows the folder, not the files in it."""


class UserError(Exception):
    """Bad input, told so that the user can mend it.

    Parameters
    ----------
    file
        The file (or other named input) at fault.
    reason
        What is wrong with it, in one sentence without a final full stop.
    remedy
        What the user can do about it, in one sentence without a final full stop.
    """

    def __init__(self, file: str | os.PathLike[str], reason: str, remedy: str) -> None:
        self.file = os.fspath(file)
        self.reason = reason
        self.remedy = remedy
        super().__init__(self.file, self.reason, self.remedy)

    def __str__(self) -> str:
        return f"{self.file}: {self.reason}. {self.remedy}."
