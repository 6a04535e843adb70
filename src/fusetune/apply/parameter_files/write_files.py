"""Writes the parameter files of a decision, the way back of each beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fusetune.apply.parameter_files.names import ALL, ALL_BACK, BEST, PARAMETER_FILES, REPLAY, REPLAY_DYNAMIC, ROLLBACK
from fusetune.apply.parameter_files.vehicle_changes import VehicleChanges
from fusetune.apply.parameter_files.vehicle_parameters import VehicleParameters
from fusetune.px4.flight import ParameterValue
from fusetune.px4.parameters.float_text import float32_text
from fusetune.px4.parameters.line_files import (
    TimedEntry,
    write_parm,
    write_replay_params,
    write_replay_params_dynamic,
    write_shell_script,
)
from fusetune.px4.parameters.params_file import ParamEntry, write_params
from fusetune.px4.parameters.release_names import VehicleParameter
from fusetune.storage.files import AnyPath

_PARAMETERS_IN_USE = "all parameters that the log names: PX4 logs those in use"


@dataclass(frozen=True)
class FilesOrigin:
    """What the files say of where they come from.

    Attributes
    ----------
    head : comment lines: decision, vehicle, flights
    reason : why the values change: the gain that is expected, with its interval; above each of them
    log : flight whose log has the values before
    scored_from_s : when that flight begins to be scored, s from the start of its log; None where it is not
    """

    head: tuple[str, ...]
    reason: str
    log: str
    scored_from_s: float | None = None


def write_parameter_files(
    folder: AnyPath, changes: VehicleChanges, vehicle: VehicleParameters, origin: FilesOrigin
) -> list[Path]:
    """Write `PARAMETER_FILES` to a folder; returns them in that order.

    Where nothing changes they hold no change, and say so; `all_params.params` is then what the vehicle has.
    """
    folder = Path(folder)
    alone = dict(changes.alone)
    new = [_entry(one, one.value, _why(one, alone.get(one.name, ""), origin.reason)) for one in changes.parameters]
    old = [_entry(one, one.previous, _back(one)) for one in changes.parameters]
    kept = _kept(changes)
    forward = ("fusetune: parameters to load", *origin.head, *kept)
    back = ("fusetune: the values before, to go back", *origin.head, *kept)
    for name, entries, head in ((BEST, new, forward), (ROLLBACK, old, back)):
        write_params(folder / f"{name}.params", entries, vehicle.header(head), vehicle.address)
        write_parm(folder / f"{name}.parm", entries, head)
        write_shell_script(folder / f"{name}.sh", entries, _for_the_shell(f"{name}.sh", head))
    for name, entries, head in ((ALL, new, forward), (ALL_BACK, old, back)):
        every = _with_others(entries, vehicle)
        told = (*head, _PARAMETERS_IN_USE, *_left_out(vehicle))
        write_params(folder / f"{name}.params", every, vehicle.header(told), vehicle.address)
    replayed = (f"for PX4's replay of the log of {origin.log}", *forward)
    write_replay_params(folder / REPLAY, new, replayed)
    _write_dynamic(folder / REPLAY_DYNAMIC, changes, new, replayed, origin)
    return [folder / name for name in PARAMETER_FILES]


def _write_dynamic(
    path: Path, changes: VehicleChanges, new: Sequence[ParamEntry], head: tuple[str, ...], origin: FilesOrigin
) -> None:
    """The change in mid-flight: until the flight is scored both filters are one, so that the values differ alone."""
    after_s = origin.scored_from_s
    needs_start = {one.name for one in changes.parameters if one.reboot_required}
    timed = [TimedEntry(one, after_s) for one in new if one.name not in needs_start] if after_s is not None else []
    notes = [f"{name} is read when the estimator starts: {REPLAY} alone has it" for name in sorted(needs_start)]
    if after_s is None and new:
        notes = ["that flight was not scored: there is no time for the values to take effect at"]
    told = "name, value, seconds from the start of the log: until then the values of the log"
    write_replay_params_dynamic(path, timed, (*head, told, *notes))


def _entry(one: VehicleParameter, value: ParameterValue, comments: tuple[str, ...]) -> ParamEntry:
    return ParamEntry(one.name, value, one.type, comments)


def _with_others(entries: Sequence[ParamEntry], vehicle: VehicleParameters) -> list[ParamEntry]:
    changed = {one.name: one for one in entries}
    others = (
        ParamEntry(name, value, "INT32" if isinstance(value, int) else "FLOAT")
        for name, value in vehicle.values.items()
        if name not in changed
    )
    return sorted((*others, *entries), key=lambda one: one.name)


def _left_out(vehicle: VehicleParameters) -> tuple[str, ...]:
    """Parameters without a value that can be loaded; of a name that is none it is only told that there is one."""
    if not vehicle.unsound:
        return ()
    names = [name if name.isascii() and name.isidentifier() else "a broken name" for name in vehicle.unsound]
    return (f"left out, as the log holds no value that can be loaded: {', '.join(names)}",)


def _kept(changes: VehicleChanges) -> tuple[str, ...]:
    if changes.refused:
        first, *others = changes.refused
        more = (f"and so {len(others)} more",) if others else ()
        return ("There is nothing to load:", f"{first.name}: {first.reason}. {first.remedy}.", *more)
    return () if changes.parameters else ("The present parameters are kept: there is nothing to load.",)


def _for_the_shell(name: str, head: tuple[str, ...]) -> tuple[str, ...]:
    return (*head, f"on the vehicle: sh /fs/microsd/{name}, or paste it into the MAVLink console")


def _why(one: VehicleParameter, alone: str, reason: str) -> tuple[str, ...]:
    lines = [
        f"previous value {_number(one.previous, one)}, new value {_number(one.value, one)}",
        f"stands for {', '.join(one.stands_for)}" if one.stands_for != (one.name,) else "",
        "" if one.is_logged else "the log does not name it: the previous value is the default of the release",
        alone,
        reason,
        "takes effect after a reboot" if one.reboot_required else "",
    ]
    return tuple(filter(None, lines))


def _back(one: VehicleParameter) -> tuple[str, ...]:
    reboot = ("takes effect after a reboot",) if one.reboot_required else ()
    return (f"back from {_number(one.value, one)}", *reboot)


def _number(value: ParameterValue, one: VehicleParameter) -> str:
    text = f"{int(value)}" if one.type == "INT32" else float32_text(value)
    return f"{text} {one.unit}".rstrip()
