"""Who flew: by what logs of PX4 say of board, airframe and simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusetune.px4.flight import Flight, ParameterHistory
from fusetune.px4.ulog.reader import read_ulog
from fusetune.px4.vehicle_identity import OWN_SIMULATOR, VehicleIdentity, vehicle_identity

UUID = "00010000000020343457544e5015003a0043"


def log(info: dict[str, Any], parameters: dict[str, float] | None = None, **status: int) -> Flight:
    """A flight of which nothing but its head and `vehicle_status` is known."""
    time = np.arange(3, dtype=np.int64)
    table = {"timestamp": time, **{name: np.full(3, value, np.uint8) for name, value in status.items()}}
    topics = {("vehicle_status", 0): table} if status else {}
    return Flight("made", topics, ParameterHistory(dict(parameters or {})), info=info)


def test_board_and_airframe_name_a_vehicle() -> None:
    flight = log({"ver_hw": "PX4_FMU_V4", "sys_uuid": UUID}, {"SYS_AUTOSTART": 4011, "MAV_TYPE": 2, "SYS_HITL": 0})
    found = vehicle_identity(flight)
    assert found == VehicleIdentity(UUID, "PX4_FMU_V4", "4011", "quadrotor", "real")
    assert (found.name, found.in_words) == ("PX4_FMU_V4-003a0043-4011", "quadrotor PX4_FMU_V4-003a0043-4011")


@pytest.mark.parametrize(
    ("info", "parameters", "status", "kind"),
    [
        ({"ver_hw": "PX4_SITL"}, {}, {}, "SITL"),
        ({"ver_hw": OWN_SIMULATOR, "sys_uuid": "quadrotor"}, {}, {}, "SITL"),
        # SYS_HITL: 1 HITL, 2 a simulator on the board, -1 an external one; before v1.8 only vehicle_status tells
        ({"ver_hw": "PX4_FMU_V5"}, {"SYS_HITL": 1}, {}, "HITL"),
        ({"ver_hw": "PX4_FMU_V5"}, {"SYS_HITL": 2}, {}, "HITL"),
        ({"ver_hw": "PX4_FMU_V5"}, {"SYS_HITL": -1}, {}, "HITL"),
        ({"ver_hw": "PX4FMU_V4"}, {}, {"hil_state": 1}, "HITL"),
        ({"ver_hw": "PX4FMU_V4"}, {"SYS_HITL": 0}, {"hil_state": 0}, "real"),
        ({}, {}, {}, "real"),
    ],
)
def test_what_is_simulated_is_no_real_vehicle(
    info: dict[str, Any], parameters: dict[str, float], status: dict[str, int], kind: str
) -> None:
    found = vehicle_identity(log(info, parameters, **status))
    assert (found.kind, found.is_real) == (kind, kind == "real")
    assert ("simulated" in found.in_words) == (kind != "real")


def test_without_an_airframe_the_kind_of_vehicle_tells_apart() -> None:
    wing, rotors = (vehicle_identity(log({"ver_hw": "PX4_SITL"}, vehicle_type=kind)) for kind in (2, 1))
    assert (wing.name, rotors.name) == ("PX4_SITL-fixed_wing", "PX4_SITL-rotary_wing")
    assert not wing.is_same(rotors)


def test_another_airframe_board_or_a_simulator_on_it_is_another_vehicle() -> None:
    one = VehicleIdentity(UUID, "PX4_FMU_V4", "4011", "quadrotor")
    assert one.is_same(VehicleIdentity(UUID, "PX4_FMU_V4", "4011", ""))  # the same board and airframe
    for other in (
        VehicleIdentity(UUID, "PX4_FMU_V4", "8001", "quadrotor"),
        VehicleIdentity(UUID[:-1] + "4", "PX4_FMU_V4", "4011", "quadrotor"),
        VehicleIdentity(UUID, "PX4_FMU_V4", "4011", "quadrotor", "HITL"),
        VehicleIdentity("", "PX4_FMU_V4", "4011", "quadrotor"),
    ):
        assert not one.is_same(other)


def test_logs_that_name_no_board_are_of_one_vehicle_where_all_else_is_alike() -> None:
    old = VehicleIdentity("", "PX4FMU_V2", "4001", "quadrotor")
    assert old.is_same(VehicleIdentity("", "PX4FMU_V2", "4001", "quadrotor"))


@pytest.mark.parametrize("asked", ["PX4_FMU_V4-003a0043-4011", "px4_fmu_v4", UUID, UUID[:8], UUID.upper()])
def test_a_vehicle_is_called_by_how_its_name_or_id_begins(asked: str) -> None:
    assert VehicleIdentity(UUID, "PX4_FMU_V4", "4011", "quadrotor").is_called(asked)


@pytest.mark.parametrize("asked", ["4011", "PX4_FMU_V5", UUID + "0"])
def test_it_is_not_called_otherwise(asked: str) -> None:
    assert not VehicleIdentity(UUID, "PX4_FMU_V4", "4011", "quadrotor").is_called(asked)


@pytest.mark.parametrize("value", [b"\xff\x00", 3.5, None, ["PX4"], "PX4\x00_SITL\n"])
def test_damaged_information_is_no_error(value: object) -> None:
    flight = log({"ver_hw": value, "sys_uuid": value}, {"SYS_AUTOSTART": float("nan"), "MAV_TYPE": 1e30})
    found = vehicle_identity(flight)
    assert found.airframe == found.type == ""
    assert found.hardware in ("", "PX4_SITL")


@given(st.builds(VehicleIdentity, *(st.text(max_size=40),) * 4, st.sampled_from(["real", "SITL", "HITL"])))
def test_columns_are_read_again(identity: VehicleIdentity) -> None:
    assert VehicleIdentity.from_row(identity.columns()) == identity
    assert identity.columns()["vehicle"] == identity.name


def test_logs_of_one_owner_are_of_two_vehicles(shared_logs: Path) -> None:
    # the README of the logs: one quadrotor on 2021-8-12, one octorotor before
    quadrotor, other, octorotor, sitl = (
        vehicle_identity(read_ulog(shared_logs / f"{name}.ulg"))
        for name in (
            "SkyRats__log_7_2021-8-12-15-49-54",
            "SkyRats__log_10_2021-8-12-15-55-52",
            "SkyRats__log_3_2021-5-23-14-32-52",
            "erdemarslan380__sitl_windy",
        )
    )
    assert quadrotor.is_same(other)
    assert not quadrotor.is_same(octorotor)
    assert [one.name for one in (quadrotor, octorotor, sitl)] == [
        "PX4_FMU_V4-003a0043-4011",
        "PX4_FMU_V5-003a002d-8001",
        "PX4_SITL-4001",
    ]
    assert (octorotor.type, sitl.kind) == ("octorotor", "SITL")
