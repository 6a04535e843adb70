"""Parameter files of one `NAME value` a line: MAVProxy's and pymavlink's ``.parm``, scripts of PX4's shell, and what
PX4's replay takes.

All are ASCII with a line of a comment above what it is about: pymavlink reads with the encoding of its system, PX4's
replay skips lines that begin with ``#``, and the shell of a board is cut at its line length.

References
----------
``MAVParmDict.load`` of pymavlink; ``Replay::setUserParams`` and ``readDynamicParams`` of PX4's
``src/modules/replay/Replay.cpp``; the commands ``param set`` and ``param save`` of PX4.
"""

from __future__ import annotations

import math
import os
import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fusetune.errors import UserError
from fusetune.px4.parameters.ekf2_parameters import as_float32
from fusetune.px4.parameters.float_text import float32_text
from fusetune.px4.parameters.params_file import PARAMETER_NAME, ParamEntry, read_params
from fusetune.storage.files import AnyPath, atomic_path

_WHOLE = re.compile(r"[+-]?\d+")
_SHELL_WIDTH = 72
"""NuttX cuts lines of a script at CONFIG_NSH_LINELEN, of which PX4's smallest boards have 80, and runs the rest."""


@dataclass(frozen=True)
class TimedEntry:
    """A value that PX4's replay sets while it runs.

    Attributes
    ----------
    after_s : seconds from the start of the log
    """

    entry: ParamEntry
    after_s: float


def write_parm(path: AnyPath, entries: Sequence[ParamEntry], head: Sequence[str] = ()) -> None:
    """Write a ``.parm``, as pymavlink's `MAVParmDict` and MAVProxy's `param load` read it.

    Raises
    ------
    ValueError
        Of this and the other writers: a name is none of PX4's or appears twice, a value is not finite or not whole.
    """
    _demand_names(entries)
    lines = [f"{entry.name:<16} {_value(entry)}" for entry in entries]
    _write(path, head, _commented(entries, lines))


def write_shell_script(path: AnyPath, entries: Sequence[ParamEntry], head: Sequence[str] = ()) -> None:
    """Write a script for PX4's shell that sets the parameters and saves them."""
    _demand_names(entries)
    lines = _commented(entries, [f"param set {entry.name} {_value(entry)}" for entry in entries])
    _write(path, head, [*lines, *(["param save"] if entries else [])], _SHELL_WIDTH)


def write_replay_params(path: AnyPath, entries: Sequence[ParamEntry], head: Sequence[str] = ()) -> None:
    """Write ``replay_params.txt``: values that PX4's replay takes from its start on, in place of the log's."""
    _demand_names(entries)
    _write(path, head, _commented(entries, [f"{entry.name} {_value(entry)}" for entry in entries]))


def write_replay_params_dynamic(path: AnyPath, timed: Sequence[TimedEntry], head: Sequence[str] = ()) -> None:
    """Write ``replay_params_dynamic.txt``: values that PX4's replay takes at a time of the log."""
    for one in timed:
        _demand_names([one.entry])
        if not (math.isfinite(one.after_s) and one.after_s >= 0.0):
            raise ValueError(f"{one.after_s} is no time from the start of a log")
    ordered = sorted(timed, key=lambda one: one.after_s)
    lines = [f"{one.entry.name} {_value(one.entry)} {one.after_s:.3f}" for one in ordered]
    _write(path, head, _commented([one.entry for one in ordered], lines))


def read_parm(path: AnyPath) -> list[ParamEntry]:
    """Read ``NAME value`` lines, of a ``.parm`` or a ``replay_params.txt``; comments directly above a line are its own.

    A value without point or exponent is taken for an INT32, which is what these files can tell of a type.

    Raises
    ------
    UserError
        The file cannot be read, or a line is something else.
    """
    return [_entry(path, number, words, comments) for number, words, comments in _lines(path, 2)]


def read_parameter_file(path: AnyPath) -> list[ParamEntry]:
    """Read a ``.params`` of QGroundControl, or any file of ``NAME value`` lines; `UserError` as of their readers."""
    return read_params(path) if Path(path).suffix == ".params" else read_parm(path)


def read_shell_script(path: AnyPath) -> list[ParamEntry]:
    """Read the values that a script sets; `UserError` as of `read_parm`, and where a command is none of ours."""
    found = []
    for number, words, comments in _lines(path, None):
        if words[:2] == ["param", "set"] and len(words) == 4:
            found.append(_entry(path, number, words[2:], comments))
        elif words != ["param", "save"]:
            raise UserError(path, f"line {number} neither sets nor saves parameters", "Write the script again")
    return found


def read_replay_params_dynamic(path: AnyPath) -> list[TimedEntry]:
    """Read values with their times; `UserError` as of `read_parm`."""
    found = []
    for number, words, comments in _lines(path, 3):
        try:
            found.append(TimedEntry(_entry(path, number, words[:2], comments), float(words[2])))
        except ValueError as error:
            raise _no_parameter(path, number) from error
    return found


def _demand_names(entries: Sequence[ParamEntry]) -> None:
    names = [entry.name for entry in entries]
    if len(set(names)) != len(names):
        raise ValueError("a parameter appears twice")
    for name in names:
        if not PARAMETER_NAME.fullmatch(name):
            raise ValueError(f"{name!r} is no name of a parameter")


def _value(entry: ParamEntry) -> str:
    if entry.type == "FLOAT":
        text = float32_text(entry.value)
        # so that readers see that it is no whole number
        return text if any(mark in text for mark in ".e") else f"{text}.0"
    if entry.value != int(entry.value):
        raise ValueError(f"parameter {entry.name} is an INT32 but has the value {entry.value}")
    return str(int(entry.value))


def _commented(entries: Sequence[ParamEntry], lines: Sequence[str]) -> list[str]:
    return [
        text
        for entry, line in zip(entries, lines, strict=True)
        for text in (*(f"# {comment}" for comment in entry.comments), line)
    ]


def _write(path: AnyPath, head: Sequence[str], lines: Sequence[str], width: int | None = None) -> None:
    # a line of nothing parts the head from what is said of the first parameter
    whole = [*(f"# {text}" for text in head), *([""] if head else []), *lines]
    wrapped = [part for line in whole for part in _wrapped(_in_ascii(line), width)]
    with atomic_path(path) as temporary:
        temporary.write_bytes("".join(f"{line}\n" for line in wrapped).encode("ascii"))


def _wrapped(line: str, width: int | None) -> list[str]:
    """A comment in lines that the shell takes whole; commands are shorter by far."""
    if width is None or not line.startswith("#"):
        return [line]
    return textwrap.wrap(line[1:], width, initial_indent="# ", subsequent_indent="# ") or ["#"]


def _in_ascii(line: str) -> str:
    plain = line.translate({ord("–"): "-", ord("−"): "-", ord("²"): "^2", ord("³"): "^3", ord("°"): "deg"})
    # nothing but blanks may part what is in a line
    plain = "".join(letter if letter.isprintable() else " " for letter in plain)
    return plain.encode("ascii", errors="backslashreplace").decode().rstrip()


def _lines(path: AnyPath, words: int | None) -> list[tuple[int, list[str], tuple[str, ...]]]:
    """Number, words and comments of each line that is no comment."""
    try:
        text = Path(path).read_bytes().decode("ascii")
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(path, f"cannot be read ({error})", "Write the file again") from error
    found, comments = [], []
    for number, line in enumerate(text.split("\n"), start=1):
        if line.startswith("#"):
            comments.append(line[1:].strip())
        elif not line.strip():
            comments = []
        else:
            if words is not None and len(line.split()) != words:
                raise _no_parameter(path, number)
            found.append((number, line.split(), tuple(comments)))
            comments = []
    return found


def _entry(path: AnyPath, number: int, words: Sequence[str], comments: tuple[str, ...]) -> ParamEntry:
    name, text = words
    try:
        if not PARAMETER_NAME.fullmatch(name):
            raise ValueError(name)
        if _WHOLE.fullmatch(text):
            return ParamEntry(name, int(text), "INT32", comments)
        return ParamEntry(name, as_float32(float(text)), "FLOAT", comments)
    except (ValueError, OverflowError) as error:
        raise _no_parameter(path, number) from error


def _no_parameter(path: str | os.PathLike[str], number: int) -> UserError:
    return UserError(path, f"line {number} is no parameter with its value", "Write the file again")
