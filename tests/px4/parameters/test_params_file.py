"""QGroundControl's parameter files, byte for byte."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fusetune.errors import UserError
from fusetune.px4.parameters.params_file import ParamEntry, ParamsHeader, VehicleAddress, read_params, write_params

# layout and decimals as QGroundControl saves them (0.3 as float32 has the digits 0.300000011920928955…)
EXPECTED = (
    b"# Onboard parameters for Vehicle 1\n"
    b"#\n"
    b"# Stack: PX4 Pro\n"
    b"# Vehicle: Multi-Rotor\n"
    b"# Version: 1.16.0 \n"
    b"# Git Revision: 6ea3539157\n"
    b"#\n"
    b"# Vehicle-Id Component-Id Name Value Type\n"
    b"# was 0.5; follows the receiver better\n"
    b"1\t1\tEKF2_GPS_V_NOISE\t0.300000011920928955\t9\n"
    b"1\t1\tEKF2_HGT_REF\t1\t6\n"
    b"1\t1\tEKF2_MAG_DECL\t-4.072537422180175781\t9\n"
)
ENTRIES = [
    ParamEntry("EKF2_GPS_V_NOISE", 0.3, "FLOAT", ("was 0.5; follows the receiver better",)),
    ParamEntry("EKF2_HGT_REF", 1, "INT32"),
    ParamEntry("EKF2_MAG_DECL", -4.072537422180176, "FLOAT"),
]


def test_bytes_are_those_of_qgroundcontrol(tmp_path: Path) -> None:
    write_params(tmp_path / "best.params", ENTRIES, ParamsHeader(version="1.16.0", git_revision="6ea3539157"))
    assert (tmp_path / "best.params").read_bytes() == EXPECTED


def test_reading_back_gives_names_values_types_and_comments(tmp_path: Path) -> None:
    (tmp_path / "best.params").write_bytes(EXPECTED)
    entries = read_params(tmp_path / "best.params")
    assert [(entry.name, entry.type, entry.comments) for entry in entries] == [
        (entry.name, entry.type, entry.comments) for entry in ENTRIES
    ]
    assert [np.float32(entry.value) for entry in entries] == [np.float32(entry.value) for entry in ENTRIES]


def test_stage_and_vehicle_appear_in_the_head(tmp_path: Path) -> None:
    header = ParamsHeader(version="1.17.0", stage="rc", vehicle="Fixed Wing", comments=("chosen from 7 flights",))
    write_params(tmp_path / "a.params", ENTRIES[1:2], header, VehicleAddress(3, 1))
    lines = (tmp_path / "a.params").read_text().splitlines()
    assert lines[0] == "# Onboard parameters for Vehicle 3"
    assert "# Vehicle: Fixed Wing" in lines
    assert "# Version: 1.17.0 rc" in lines
    assert "# chosen from 7 flights" in lines
    assert lines[-1] == "3\t1\tEKF2_HGT_REF\t1\t6"


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(value=st.floats(width=32, allow_nan=False, allow_infinity=False, min_value=2.0**-20, max_value=2.0**20))
def test_eighteen_decimals_keep_the_float32(tmp_path: Path, value: float) -> None:
    write_params(tmp_path / "a.params", [ParamEntry("EKF2_X", value, "FLOAT")])
    (entry,) = read_params(tmp_path / "a.params")
    # cutting at 18 decimals errs by 5e-19 at most, far below half a float32 step at 2**-20 (5.7e-14)
    assert np.float32(entry.value) == np.float32(value)


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ([ParamEntry("EKF2_FAR_TOO_LONG_A_NAME", 1, "INT32")], "longer than 16"),
        ([ENTRIES[1], ENTRIES[1]], "twice"),
        ([ParamEntry("EKF2_HGT_REF", 1.5, "INT32")], "INT32"),
        ([ParamEntry("EKF2_X", float("inf"), "FLOAT")], "inf"),
        ([ParamEntry("EKF2_X", 1.0, "FLOAT", ("two\nlines",))], "line break"),
    ],
)
def test_what_the_format_cannot_hold_is_refused(tmp_path: Path, entries: list[ParamEntry], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        write_params(tmp_path / "a.params", entries)
    assert not (tmp_path / "a.params").exists()


@pytest.mark.parametrize(
    "line", ["1\t1\tEKF2_X\t1.0", "1 1 EKF2_X 1.0 9", "1\t1\tEKF2_X\tone\t9", "1\t1\tEKF2_X\t1\t7"]
)
def test_lines_that_are_no_parameter_are_named(tmp_path: Path, line: str) -> None:
    (tmp_path / "a.params").write_text(f"# head\n{line}\n")
    with pytest.raises(UserError, match="line 2 is not a parameter"):
        read_params(tmp_path / "a.params")
