"""Parameter files as the programs read them that they are for, written from what these programs document and do.

Nothing of the package is used, so that both sides cannot share a mistake. pymavlink is asked itself, by the tests.

``python -m benchmarks.parameter_readers results/apply/best_params.params`` prints what QGroundControl takes, field by
field.

References
----------
QGroundControl, ``ParameterManager::readParametersFromStream``; PX4, ``src/modules/replay/Replay.cpp`` (`setUserParams`,
`readDynamicParams`), ``src/systemcmds/param/param.cpp`` (`param set`); NuttX, ``nshlib`` (lines of a script).
"""

from __future__ import annotations

import re
import shlex
import struct
import sys
from dataclasses import dataclass, field
from pathlib import Path

MAV_PARAM_TYPES = {1: "UINT8", 2: "INT8", 3: "UINT16", 4: "INT16", 5: "UINT32", 6: "INT32", 9: "REAL32", 10: "REAL64"}
SHELL_LINE = 80
"""CONFIG_NSH_LINELEN of PX4's smallest boards; what is longer is cut, and the rest run as a command."""


@dataclass
class QgcLoad:
    """What QGroundControl makes of a file.

    Attributes
    ----------
    set_to : (component, name) → value, as the vehicle then stores it
    ignored : lines that it passes over without a word
    missing, wrong_type : names that it warns of
    """

    set_to: dict[tuple[int, str], float | int] = field(default_factory=dict)
    ignored: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    wrong_type: list[str] = field(default_factory=list)


def load_in_qgroundcontrol(text: str, vehicle_id: int, known: dict[str, str]) -> QgcLoad:
    """Load a file into a vehicle, whose parameters and types (`INT32`, `REAL32`) are known.

    Raises
    ------
    ValueError
        The file is one of another vehicle.
    """
    loaded = QgcLoad()
    for line in re.split(r"\r?\n", text):
        if line.startswith("#"):
            continue
        fields = line.split("\t")
        if len(fields) != 5:
            loaded.ignored += [line] if line else []
            continue
        if int(fields[0]) != vehicle_id:
            raise ValueError(f"saved from system {fields[0]}, and the vehicle is system {vehicle_id}")
        component, name, value, kind = int(fields[1]), fields[2], fields[3], MAV_PARAM_TYPES[int(fields[4])]
        if name not in known:
            loaded.missing.append(name)
        elif known[name] != kind:
            loaded.wrong_type.append(name)
        else:
            loaded.set_to[component, name] = int(value) if kind == "INT32" else stored(value)
    return loaded


def replay_params(text: str) -> dict[str, float]:
    """What PX4's replay takes of `replay_params.txt`: lines that are empty or begin with # are passed over."""
    lines = [line for line in text.split("\n") if line and line[0] != "#"]
    return {line.split()[0]: float(line.split()[1]) for line in lines}


def replay_params_dynamic(text: str) -> list[tuple[str, float, float]]:
    """Name, value and seconds of each line of `replay_params_dynamic.txt`."""
    lines = [line.split() for line in text.split("\n") if line and line[0] != "#"]
    return [(name, float(value), float(after_s)) for name, value, after_s in lines]


def run_in_shell(text: str) -> tuple[dict[str, str], bool]:
    """Run a script as NuttX's shell does: what is set, and whether it was saved after the last.

    Raises
    ------
    ValueError
        A line is too long, or no command that PX4 has.
    """
    values: dict[str, str] = {}
    saved = True
    for line in text.split("\n"):
        if len(line) >= SHELL_LINE:
            raise ValueError(f"cut by the shell: {line}")
        words = [] if line.lstrip().startswith("#") else shlex.split(line)
        if words[:2] == ["param", "set"] and len(words) == 4:
            values[words[2]], saved = words[3], False
        elif words == ["param", "save"]:
            saved = True
        elif words:
            raise ValueError(f"no such command: {line}")
    return values, saved


def stored(text: str) -> float:
    """A number as PX4 stores it when it reads it as a double and makes a float32 of it."""
    return float(struct.unpack("<f", struct.pack("<f", float(text)))[0])


def main(files: list[str]) -> None:
    """Print the fields of every line."""
    for file in files:
        print(f"{Path(file).name}")
        for line in Path(file).read_text(encoding="utf-8").split("\n"):
            if line.startswith("#") or not line:
                print(f"  comment    {line}" if line else "  end")
                continue
            vehicle, component, name, value, code = line.split("\t")
            kind = MAV_PARAM_TYPES[int(code)]
            held = int(value) if kind == "INT32" else stored(value)
            print(
                f"  parameter  vehicle {vehicle}, component {component}, {name}, {value}, type {code}: {kind} {held!r}"
            )


if __name__ == "__main__":
    main(sys.argv[1:])
