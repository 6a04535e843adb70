"""What an upload needs beside a plain installation."""

from __future__ import annotations

from importlib.util import find_spec

from fusetune.errors import UserError

INSTALL = "Install it: pip install pymavlink pyserial (in a checkout: make with-upload)"


def require_pymavlink() -> None:
    """See that pymavlink is there; raises `UserError` where it is not."""
    if find_spec("pymavlink") is None:
        raise UserError("upload", "needs pymavlink, which is not installed", INSTALL)
