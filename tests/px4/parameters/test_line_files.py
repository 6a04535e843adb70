"""Parameter files of a line a parameter: through the readers of the programs that they are for, and back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from benchmarks.parameter_readers import (
    load_in_qgroundcontrol,
    replay_params,
    replay_params_dynamic,
    run_in_shell,
    stored,
)
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pymavlink.mavparm import MAVParmDict

from fusetune.errors import UserError
from fusetune.px4.parameters.ekf2_parameters import as_float32
from fusetune.px4.parameters.line_files import (
    TimedEntry,
    read_parm,
    read_replay_params_dynamic,
    read_shell_script,
    write_parm,
    write_replay_params,
    write_replay_params_dynamic,
    write_shell_script,
)
from fusetune.px4.parameters.params_file import ParamEntry, VehicleAddress, read_params, write_params

NAMES = st.from_regex(r"[A-Z][A-Z0-9_]{0,15}", fullmatch=True).filter(
    lambda name: name not in MAVParmDict().exclude_load
)
COMMENTS = st.lists(st.text(max_size=120).filter(lambda text: "\n" not in text and "\r" not in text), max_size=2)
FLOATS = st.floats(width=32, allow_nan=False, allow_infinity=False)
WHOLE = st.integers(-(2**31), 2**31 - 1)


def entry(name: str, value: float | int, comments: list[str]) -> ParamEntry:
    return ParamEntry(name, value, "INT32" if isinstance(value, int) else "FLOAT", tuple(comments))


ENTRIES = st.lists(st.builds(entry, NAMES, FLOATS | WHOLE, COMMENTS), max_size=5, unique_by=lambda one: one.name)


def values_of(entries: list[ParamEntry]) -> dict[str, tuple[str, float | int]]:
    return {one.name: (one.type, one.value) for one in entries}


@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(entries=ENTRIES, head=COMMENTS)
def test_every_reader_gets_every_bit_of_every_value(tmp_path: Path, entries: list[ParamEntry], head: list[str]) -> None:
    wanted = values_of(entries)
    write_params(tmp_path / "a.params", entries, address=VehicleAddress(7, 1))
    known = {one.name: "INT32" if one.type == "INT32" else "REAL32" for one in entries}
    loaded = load_in_qgroundcontrol((tmp_path / "a.params").read_text(encoding="utf-8"), 7, known)
    assert loaded.set_to == {(1, name): value for name, (_, value) in wanted.items()}
    assert (loaded.ignored, loaded.missing, loaded.wrong_type) == ([], [], [])
    assert values_of(read_params(tmp_path / "a.params")) == wanted

    write_parm(tmp_path / "a.parm", entries, head)
    theirs = MAVParmDict()
    assert theirs.load(str(tmp_path / "a.parm"))
    # pymavlink keeps doubles, which are sent as float32, or bytewise where the vehicle says INT32
    assert {
        name: stored(repr(value)) if wanted[name][0] == "FLOAT" else int(value) for name, value in theirs.items()
    } == {name: value for name, (_, value) in wanted.items()}
    assert values_of(read_parm(tmp_path / "a.parm")) == wanted

    write_shell_script(tmp_path / "a.sh", entries, head)
    texts, saved = run_in_shell((tmp_path / "a.sh").read_text(encoding="ascii"))
    assert {name: int(text) if wanted[name][0] == "INT32" else stored(text) for name, text in texts.items()} == {
        name: value for name, (_, value) in wanted.items()
    }
    assert saved
    assert values_of(read_shell_script(tmp_path / "a.sh")) == wanted

    write_replay_params(tmp_path / "r.txt", entries, head)
    taken = replay_params((tmp_path / "r.txt").read_text(encoding="ascii"))
    assert {name: as_float32(value) if wanted[name][0] == "FLOAT" else int(value) for name, value in taken.items()} == {
        name: value for name, (_, value) in wanted.items()
    }
    timed = [TimedEntry(one, 1.25 * number) for number, one in enumerate(entries)]
    write_replay_params_dynamic(tmp_path / "d.txt", timed, head)
    assert [(name, after_s) for name, _, after_s in replay_params_dynamic((tmp_path / "d.txt").read_text("ascii"))] == [
        (one.entry.name, one.after_s) for one in timed
    ]
    assert values_of([one.entry for one in read_replay_params_dynamic(tmp_path / "d.txt")]) == wanted


def test_comments_stay_with_their_parameter_and_never_become_one(tmp_path: Path) -> None:
    bad = "by “±3 %” over m/s²\x85param set X 1\u2028Y 2"
    write_shell_script(tmp_path / "a.sh", [entry("EKF2_X", 0.3, [bad, "second"])], [bad])
    text = (tmp_path / "a.sh").read_text("ascii")
    assert run_in_shell(text) == ({"EKF2_X": "0.3"}, True)
    assert "m/s^2" in text
    (one,) = read_shell_script(tmp_path / "a.sh")
    assert one.comments[-1] == "second"
    write_params(tmp_path / "a.params", [entry("EKF2_X", 0.3, [bad])])
    assert read_params(tmp_path / "a.params")[0].comments == (bad,)


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        ([entry("EKF2_X", float("nan"), [])], "nan"),
        ([ParamEntry("EKF2_X", 0.5, "INT32")], "INT32"),
        ([entry("EKF2 X", 1, [])], "no name"),
        ([entry("X", 1, []), entry("X", 2, [])], "twice"),
    ],
)
def test_what_no_vehicle_takes_is_not_written(tmp_path: Path, bad: list[ParamEntry], said: str) -> None:
    for write in (write_parm, write_shell_script, write_replay_params):
        with pytest.raises(ValueError, match=said):
            write(tmp_path / "a", bad)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ValueError, match="no time"):
        write_replay_params_dynamic(tmp_path / "a", [TimedEntry(entry("X", 1, []), -1.0)])


@pytest.mark.parametrize(
    ("reader", "text"),
    [(read_parm, "X"), (read_parm, "X one"), (read_shell_script, "rm X"), (read_replay_params_dynamic, "X 1 soon")],
)
def test_lines_that_are_something_else_are_named(tmp_path: Path, reader: Any, text: str) -> None:
    (tmp_path / "a").write_text(f"# head\n{text}\n")
    with pytest.raises(UserError, match="line 2"):
        reader(tmp_path / "a")
