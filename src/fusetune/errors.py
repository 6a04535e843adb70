"""The error that is meant for the user: what is wrong with which file, and what to do about it."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile

RUN_AGAIN = "Delete it and run the pipeline again"
"""What mends a damaged file of results."""
FOLDER_AGAIN = "Delete the whole folder {folder} and run the pipeline again"
"""What mends a file in the folder of a saved flight: the pipeline knows the folder, not the files in it."""
OF_DAMAGE = (LookupError, ValueError, TypeError, ArithmeticError)
"""What code ends in that is given a log from which damage, or the logger, took a topic, a field or its values."""
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_NOT_ALLOWED = (errno.EACCES, errno.EPERM, errno.EROFS)
_MAKE_ROOM = "Make room on that disk and start again; what is finished stays"


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


def demand_room(folder: str | os.PathLike[str], least_bytes: int) -> None:
    """See that a folder can be written and that its disk has room, before anything is begun.

    Raises
    ------
    UserError
        It cannot, or there is less.
    """
    try:
        os.makedirs(folder, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            free_bytes = shutil.disk_usage(folder).free
    except OSError as error:
        reason = f"cannot be written ({error.strerror})"
        raise UserError(folder, reason, "Mend its permissions, or make room on that disk") from error
    if free_bytes < least_bytes:
        raise UserError(folder, f"the disk has only {free_bytes / 1e6:.1f} MB left", _MAKE_ROOM)


def write_error(error: OSError, place: str | os.PathLike[str]) -> UserError | None:
    """What a failure to write means for the user; `None` for one that is no matter of room or of permissions.

    Parameters
    ----------
    place
        File or folder to name where the error does not say which file it was.
    """
    # libraries in C++ hand the reason on as text only
    number = error.errno or next((code for code in _NO_ROOM if os.strerror(code) in str(error)), None)
    if number in _NO_ROOM:
        remedy = _MAKE_ROOM
    elif number in _NOT_ALLOWED:
        remedy = "Mend the permissions, or work in a folder that can be written"
    else:
        return None
    return UserError(error.filename or place, f"cannot be written ({os.strerror(number)})", remedy)
