"""The command line: finds the sub-command that is asked for, and ends as `command` says."""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Mapping, Sequence

from fusetune import __version__
from fusetune.cli import (
    cards,
    confirm,
    conformance,
    covariance,
    design,
    diagnose,
    fidelity,
    history,
    mission,
    plot,
    replay,
    save,
    search,
    simulate,
    study,
    upload,
)
from fusetune.cli.command import INTERRUPTED, NO_READER, USER_ERROR, Command
from fusetune.errors import UserError

COMMANDS: Mapping[str, Command] = {
    "design": design,
    "mission": mission,
    "study": study,
    "cards": cards,
    "covariance": covariance,
    "simulate": simulate,
    "save": save,
    "replay": replay,
    "fidelity": fidelity,
    "diagnose": diagnose,
    "conformance": conformance,
    "search": search,
    "plot": plot,
    "confirm": confirm,
    "history": history,
    "upload": upload,
}
"""In the order of the pipeline."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one sub-command; returns the exit status."""
    # read when NumPy is first imported; the matrices are too small for threads, which would only cost time
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    _print_any_name()
    options = _parser().parse_args(arguments)
    try:
        status = COMMANDS[options.command].run(options)
        if sys.stdout is not None:
            sys.stdout.flush()
    except UserError as error:
        return _failed(str(error))
    except KeyboardInterrupt:
        print("fusetune: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # else Python tries once more to write what is left, and complains
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return NO_READER
    except OSError as error:
        return _failed(f"{error.filename or 'the output'}: {error.strerror or error}. Mend the path or make room.")
    return status


def _print_any_name() -> None:
    """Let names of files that the terminal cannot show be printed as escapes instead of ending the command."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _failed(message: str) -> int:
    print(f"fusetune: {message}", file=sys.stderr)
    return USER_ERROR


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fusetune",
        description="Single steps of the pipeline; `snakemake` runs them all.",
        epilog="Exit status: 0 all is done; 1 a log was refused, diagnose warns, confirm does not confirm; 2 the "
        "command or a file is unusable; 3 diagnose found a failure, upload took all back; 4 upload is not finished.",
    )
    parser.add_argument("--version", action="version", version=f"fusetune {__version__}")
    commands = parser.add_subparsers(title="commands", dest="command", required=True, metavar="COMMAND")
    for name, command in COMMANDS.items():
        command.add_arguments(commands.add_parser(name, help=command.HELP))
    return parser
