"""The parameter files of a vehicle, as its tools load them."""

from __future__ import annotations

from pathlib import Path

import pytest
from benchmarks.parameter_readers import load_in_qgroundcontrol, replay_params, replay_params_dynamic, run_in_shell
from pymavlink.mavparm import MAVParmDict

from fusetune.apply.parameter_changes import parameter_changes
from fusetune.apply.parameter_files.names import PARAMETER_FILES
from fusetune.apply.parameter_files.vehicle_changes import VehicleChanges, vehicle_changes
from fusetune.apply.parameter_files.vehicle_parameters import VehicleParameters, parameters_of, vehicle_parameters
from fusetune.apply.parameter_files.write_files import FilesOrigin, write_parameter_files
from fusetune.px4.flight import Flight, ParameterChange, ParameterHistory
from fusetune.px4.parameters.ekf2_parameters import as_float32
from fusetune.save.flight_folder import write_flight

V1_13_3 = 1 << 24 | 13 << 16 | 3 << 8 | 255
LOGGED = {
    "BAT1_N_CELLS": 4,
    "EKF2_ACC_NOISE": as_float32(0.35),
    "EKF2_AID_MASK": 1,
    "EKF2_GPS_DELAY": 110.0,
    "EKF2_HGT_MODE": 1,
    "EKF2_WIND_NOISE": as_float32(0.1),
    "MAV_SYS_ID": 7,
    "MAV_TYPE": 2,
    # damage: no vehicle has these
    "EKF2_MAG_NOISE": float("nan"),
    "RC\t1": 3,
    "SENS_X": float("inf"),
}
ORIGIN = FilesOrigin(("decided on 6 flights",), "errors 12 % smaller (95 % interval 8 to 16 %)", "flight_5", 12.5)


def made_flight() -> Flight:
    return Flight(
        "flight_5",
        parameters=ParameterHistory(dict(LOGGED), [ParameterChange(5, "EKF2_GPS_DELAY", 120.0)]),
        info={"ver_sw_release": V1_13_3, "ver_sw": "1234567890abcdef1234567890abcdef12345678"},
        start_timestamp=1_000_000,
    )


def changes_on(wanted: dict[str, float], vehicle: VehicleParameters) -> VehicleChanges:
    now = {"EKF2_ACC_NOISE": 0.35, "EKF2_GPS_DELAY": 120.0, "EKF2_WIND_NSD": 0.01, "EKF2_GRAV_NOISE": 1.0}
    return vehicle_changes(parameter_changes(wanted, now | {"EKF2_DRAG_CTRL": 0, "EKF2_MAG_NOISE": 0.05}), vehicle)


def test_all_tools_set_the_vehicles_own_parameters_and_go_back(tmp_path: Path) -> None:
    write_flight(tmp_path, made_flight())
    vehicle = vehicle_parameters(tmp_path)
    wanted = {"EKF2_ACC_NOISE": 0.5, "EKF2_GPS_DELAY": 160.0, "EKF2_WIND_NSD": 0.02, "EKF2_DRAG_CTRL": 1}
    changes = changes_on(wanted, vehicle)
    files = write_parameter_files(tmp_path / "out", changes, vehicle, ORIGIN)
    assert [file.name for file in files] == list(PARAMETER_FILES)
    assert all(file.is_file() for file in files)
    text = {file.name: file.read_text(encoding="utf-8") for file in files}

    # by hand: mask 1 + 32 (drag), wind noise 10 times the density; delay as it was when the log ended
    new = {"EKF2_ACC_NOISE": 0.5, "EKF2_AID_MASK": 33, "EKF2_GPS_DELAY": 160.0, "EKF2_WIND_NOISE": as_float32(0.2)}
    old = {name: LOGGED[name] for name in new} | {"EKF2_GPS_DELAY": 120.0}
    sound = {name: value for name, value in LOGGED.items() if name not in ("EKF2_MAG_NOISE", "RC\t1", "SENS_X")}
    known = {name: "INT32" if isinstance(value, int) else "REAL32" for name, value in sound.items()}
    for name, expected in (
        ("best_params", new),
        ("rollback", old),
        ("all_params", {**sound, **new}),
        ("all_rollback", {**sound, **old}),
    ):
        loaded = load_in_qgroundcontrol(text[f"{name}.params"], 7, known)
        assert loaded.set_to == {(1, one): value for one, value in expected.items()}
        assert (loaded.ignored, loaded.missing, loaded.wrong_type) == ([], [], [])
        if name.startswith("all"):
            continue
        theirs = MAVParmDict()
        theirs.load(str(tmp_path / "out" / f"{name}.parm"))
        assert {one: as_float32(value) for one, value in theirs.items()} == expected
        values, saved = run_in_shell(text[f"{name}.sh"])
        assert {one: as_float32(float(value)) for one, value in values.items()} == expected
        assert saved
    with pytest.raises(ValueError, match="system 7"):
        load_in_qgroundcontrol(text["best_params.params"], 1, known)
    assert {one: as_float32(value) for one, value in replay_params(text["replay_params.txt"]).items()} == new
    # the mask and the delay are read when the estimator starts (PX4's metadata: reboot required)
    timed = replay_params_dynamic(text["replay_params_dynamic.txt"])
    assert timed == [("EKF2_ACC_NOISE", 0.5, 12.5), ("EKF2_WIND_NOISE", 0.2, 12.5)]

    best = text["best_params.params"]
    for said in (
        "# Version: 1.13.3",
        "# Git Revision: 1234567890",
        "# previous value 0.1 m/s^2, new value 0.2",
        "# stands for EKF2_WIND_NSD",
        "# takes effect after a reboot",
        f"# {ORIGIN.reason}",
    ):
        assert said in best
    assert "EKF2_MAG_NOISE, a broken name, SENS_X" in text["all_params.params"]
    assert "EKF2_AID_MASK for EKF2_DRAG_CTRL" in changes.sentence()


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ({"EKF2_ACC_NOISE": 0.5, "EKF2_GRAV_NOISE": 2.0}, "v1.13.3, which the vehicle flies, has no such parameter"),
        ({"EKF2_ACC_NOISE": 0.5, "EKF2_MAG_NOISE": 0.03}, "a value that no vehicle can have"),
    ],
)
def test_a_set_that_the_vehicle_cannot_have_whole_is_not_loaded_in_part(
    tmp_path: Path, wanted: dict[str, float], said: str
) -> None:
    vehicle = parameters_of(made_flight())
    changes = changes_on(wanted, vehicle)
    files = write_parameter_files(tmp_path, changes, vehicle, ORIGIN)
    assert changes.parameters == ()
    assert said in changes.sentence()
    text = {file.name: file.read_text(encoding="utf-8") for file in files}
    assert "EKF2_ACC_NOISE\t0.5" not in "".join(text.values())
    assert run_in_shell(text["best_params.sh"])[0] == replay_params(text["replay_params.txt"]) == {}
    for file in ("best_params.params", "best_params.parm", "replay_params.txt"):
        assert said in text[file]
        assert "nothing to load" in text[file]
