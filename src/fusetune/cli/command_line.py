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
    compare,
    compare_releases,
    completion,
    confirm,
    conformance,
    covariance,
    decide,
    design,
    diagnose,
    fidelity,
    history,
    init,
    mission,
    plot,
    replay,
    report,
    run,
    save,
    score,
    search,
    simulate,
    study,
    upload,
)
from fusetune.cli.command import DONE, INTERRUPTED, NO_READER, USER_ERROR, Command
from fusetune.errors import UserError

GROUPS: Mapping[str, Mapping[str, Command]] = {
    "the whole pipeline": {
        "init": init,
        "run": run,
        "decide": decide,
        "report": report,
        "compare": compare,
        "history": history,
    },
    "single steps on logs": {
        "diagnose": diagnose,
        "score": score,
        "search": search,
        "plot": plot,
        "conformance": conformance,
        "save": save,
        "replay": replay,
        "fidelity": fidelity,
        "compare-releases": compare_releases,
        "confirm": confirm,
    },
    "before a flight": {
        "design": design,
        "mission": mission,
        "study": study,
        "cards": cards,
        "covariance": covariance,
        "simulate": simulate,
    },
    "the vehicle": {"upload": upload},
    "this command": {"completion": completion},
}
"""Sub-commands by what they are for."""

COMMANDS: Mapping[str, Command] = {name: command for group in GROUPS.values() for name, command in group.items()}

_STATUSES = """\
exit status:
  0    done
  1    done as far as it goes: a log was refused, or what was asked for is not so (--help of each tells)
  2    not done: the command or a file cannot be used, and one line says what to do
  3    diagnose: a failure was found; upload: what was written is taken back
  4    upload: not finished
  130  interrupted
  141  who read the output has gone"""

_BEGIN = """\
fusetune finds which EKF2 parameters a PX4 vehicle should fly with, from its logs.

  fusetune run LOG…         the whole pipeline: best_params.params, and the page that says why
  fusetune diagnose LOG…    what is wrong on these flights, and what to do about it
  fusetune init DIR         a folder to go on in

No logs at hand? `fusetune run` in an empty folder shows it on simulated flights. All commands: fusetune --help"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one sub-command; returns the exit status."""
    # read when NumPy is first imported; the matrices are too small for threads, which would only cost time
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    _print_any_name()
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    if "_ARGCOMPLETE" in os.environ:
        from fusetune.cli.output.completers import complete

        complete(parser())
    if not arguments and sys.stdout is not None and sys.stdout.isatty():
        print(_BEGIN)
        return DONE
    options = parser().parse_args(arguments)
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


_KEEP_LINES = argparse.RawDescriptionHelpFormatter
"""What stands around the options has lines of its own."""


def parser() -> argparse.ArgumentParser:
    """All sub-commands with their options."""
    whole = argparse.ArgumentParser(
        prog="fusetune",
        usage="fusetune COMMAND …    (fusetune COMMAND --help for its options and examples)",
        description=_listed(),
        epilog=_STATUSES,
        formatter_class=_KEEP_LINES,
    )
    whole.add_argument("--version", action="version", version=f"fusetune {__version__}")
    commands = whole.add_subparsers(
        dest="command", required=True, metavar="COMMAND", help=argparse.SUPPRESS, prog="fusetune"
    )
    for name, command in COMMANDS.items():
        own = commands.add_parser(
            name, help=command.HELP, description=_wrapped(_sentence(command.HELP)), formatter_class=_KEEP_LINES
        )
        command.add_arguments(own)
        own.epilog = "\n\n".join(filter(None, (_examples(command), own.epilog and _wrapped(own.epilog))))
    return whole


def _listed() -> str:
    lines = ["Which EKF2 parameters a PX4 vehicle should fly with, from its flight logs."]
    for group, commands in GROUPS.items():
        lines += ["", f"{group}:", *(f"  {name:<16} {command.HELP}" for name, command in commands.items())]
    return "\n".join(lines)


def _sentence(words: str) -> str:
    return f"{words[0].upper()}{words[1:]}."


def _examples(command: Command) -> str:
    lines = [f"  {line}\n      {words}" for line, words in command.EXAMPLES]
    return "\n".join(["examples:", *lines])


def _wrapped(text: str) -> str:
    import textwrap

    return textwrap.fill(text, 100)
