"""Hand a job over to the server of its run, and end as the job ends; run as a file, by a Python without packages.

Snakemake runs this in the place of its shell (`job_server.shell_of`), with what it would give to that. Whatever is no
script for the Python of the run, or finds no server, goes to the shell itself.
"""

from __future__ import annotations

import os
import shlex
import signal
import socket
import sys
from contextlib import suppress

SCRIPTS = os.path.join(".snakemake", "scripts")
"""The folder to which Snakemake writes the scripts that it runs."""

PREFIX = "set -euo pipefail;"
"""What Snakemake puts before a command for this shell."""

LENGTH_BYTES = 4
"""Size of the figure that goes before a job and tells how long it is."""

STATUS_BYTES = 4


def script_in(arguments: list[str], python: str) -> str | None:
    """The script that a call of the shell asks this Python to run; `None` where the call is for anything else."""
    if len(arguments) != 2 or arguments[0] != "-c" or not arguments[1].startswith(PREFIX):
        return None
    command = arguments[1].removeprefix(PREFIX).strip()
    try:
        words = shlex.split(command)
    except ValueError:
        return None
    # what the shell would have to read, as a variable, is no name as it stands
    if len(words) != 2 or command != f"{python} {shlex.quote(words[1])}":
        return None
    return words[1] if os.path.dirname(words[1]).endswith(SCRIPTS) else None


def status_of(address: str, script: str) -> int | None:
    """Exit status of a script as the server runs it, below zero that of a signal; `None` where nobody runs it."""
    umask = os.umask(0o077)
    os.umask(umask)
    environment = [name + b"=" + value for name, value in os.environb.items()]
    job = b"\0".join([os.fsencode(script), os.fsencode(os.getcwd()), b"%d" % umask, *environment])
    answer = b""
    try:
        with socket.socket(socket.AF_UNIX) as server:
            server.connect(address)
            socket.send_fds(server, [len(job).to_bytes(LENGTH_BYTES, "little")], [0, 1, 2])
            server.sendall(job)
            while len(answer) < STATUS_BYTES and (more := server.recv(STATUS_BYTES)):
                answer += more
    except OSError:
        # it never was, or has ended; then so have those that it started, which hold the same connection
        return None
    return int.from_bytes(answer, "little", signed=True) if len(answer) == STATUS_BYTES else None


def main(address: str, shell: str, python: str, *arguments: str) -> None:
    """Run a job by the server, or else by the shell."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    asked_by = os.getppid()
    script = script_in([*arguments], python)
    status = status_of(address, script) if script is not None else None
    if os.getppid() != asked_by:
        # the run has been killed, and nobody wants this any more
        os._exit(1)
    if status is None:
        os.execv(shell, [os.path.basename(shell), *arguments])
    if status < 0:
        with suppress(OSError):  # what cannot be caught cannot be set, either
            signal.signal(-status, signal.SIG_DFL)
        os.kill(os.getpid(), -status)
    os._exit(status)


if __name__ == "__main__":
    main(*sys.argv[1:])
