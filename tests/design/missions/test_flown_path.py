"""How missions are flown: turns in place, runs with a heading that stays, rests; and what follows in time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from fusetune.design.missions.endurance import Endurance
from fusetune.design.missions.flown_path import flown_path
from fusetune.design.missions.limits import PX4_LIMITS, Limits
from fusetune.design.missions.mission import Mission, mission_of
from fusetune.design.missions.outlook import PlannedVehicle, attitude_of, motion_of, outlook
from fusetune.quaternions import rotation_matrix

QUADROTOR = Limits(12.0, 3.0, 1.5, 4.0, 12.0, 60.0, 120.0)


def mission(**keys: Any) -> Mission:
    document = {
        "name": "m",
        "home": {"lat": 47.0, "lon": 8.0, "alt": 400, "heading_deg": 10},
        "takeoff": {"altitude_m": 10},
        "landing": {"mode": "land"},
        **keys,
    }
    return mission_of(document, "m.yaml")


def test_a_turn_in_place_takes_its_time_and_stays_where_it_is() -> None:
    shapes = [{"kind": "yaw_turns", "altitude_m": 10, "north_m": 5, "step_deg": 120, "hold_s": 2, "heading_deg": 0}]
    flown = flown_path(mission(shapes=shapes), PX4_LIMITS)
    motion = motion_of(flown)
    # it sets out for the ground half the filter's window before the last leg
    begin, end = flown.leg_ends_s[1], flown.leg_ends_s[-2] - flown.path.half_window_s
    # six turns of 120° at 45 °/s, each with a rest of 2 s and half of the yaw's windows (2 · 45 / 60 + 0.6 s)
    assert end - begin == pytest.approx(6 * (120.0 / 45.0 + 0.5 * (1.5 + 0.6) + 2.0), abs=0.02)
    turning = (motion.time_s > begin + 0.1) & (motion.time_s < end - 0.1)
    assert np.ptp(motion.position[turning], axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    yaw = np.degrees(motion.yaw[turning])
    assert (yaw.min(), yaw.max()) == pytest.approx((0.0, 360.0), abs=0.5)
    # before each hold is over the vehicle looks where it was told to
    for leg, wanted in zip(range(2, 8), (120.0, 240.0, 360.0, 240.0, 120.0, 0.0), strict=True):
        at = np.array([min(flown.leg_ends_s[leg], end) - 0.5 * (1.5 + 0.6)])
        assert np.degrees(flown.yaw.evaluate(at))[0, 0] == pytest.approx(wanted, abs=1e-6)


def test_runs_are_flown_sideways_and_backwards() -> None:
    runs = {"kind": "runs", "altitude_m": 10, "distance_m": 60, "climb_m": 8, "repeats": 1, "heading_deg": 90}
    motion = motion_of(flown_path(mission(shapes=[runs], speed_m_s=6), PX4_LIMITS))
    settled = motion.time_s > 30.0
    assert np.degrees(motion.yaw[settled]) == pytest.approx(np.full(settled.sum(), 90.0))
    nose = np.column_stack([np.cos(motion.yaw), np.sin(motion.yaw)])
    forward = np.sum(motion.velocity[:, :2] * nose, axis=1)
    right = nose[:, 0] * motion.velocity[:, 1] - nose[:, 1] * motion.velocity[:, 0]
    for speed in (forward[settled], right[settled]):
        assert (speed.min(), speed.max()) == pytest.approx((-6.0, 6.0), abs=0.05)
    # and stands between them
    assert (np.linalg.norm(motion.velocity[settled], axis=1) < 1e-6).mean() > 0.1


def test_attitude_leans_with_the_acceleration_and_looks_along_the_yaw() -> None:
    motion = motion_of(flown_path(mission(shapes=[{"kind": "shuttle", "altitude_m": 10, "length_m": 60}]), PX4_LIMITS))
    rotation = rotation_matrix(attitude_of(motion))
    force = motion.acceleration - np.array([0.0, 0.0, 9.80665])
    up = -rotation[:, :, 2]
    assert np.sum(up * force, axis=1) == pytest.approx(np.linalg.norm(force, axis=1))
    heading = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    assert np.abs(np.angle(np.exp(1j * (heading - motion.yaw)))).max() < math.radians(6.0)


def test_outlook_of_a_hop_by_hand() -> None:
    hover = {"kind": "hover", "altitude_m": 10, "duration_s": 60}
    endurance = Endurance(hover_minutes=4.0, mass_kg=1.5, rotors=4, rotor_diameter_m=0.25, reserve=0.3)
    vehicle = PlannedVehicle("small", QUADROTOR, endurance)
    found = outlook(mission(shapes=[hover], landing={"mode": "land", "descent_speed_m_s": 1.0}), vehicle)
    names = [leg.name for leg in found.legs]
    assert names == ["take-off", "waypoint 1", "landing"]
    # windows: hypot(2 · 5, 4.5) / 4 + 2 · 4 / 12 + 0.3; half of them at each end of a vertical leg
    half = 0.5 * (math.hypot(10.0, 4.5) / 4.0 + 2.0 / 3.0 + 0.3)
    climb, descent = 10.0 / 1.5, 6.0 / 1.0 + 4.0 / 0.5
    assert found.duration_s == pytest.approx(4.0 * half + climb + 60.0 + descent, abs=0.01)
    assert (found.highest_m, found.farthest_m) == pytest.approx((10.0, 0.0), abs=1e-6)
    assert found.distance_m == pytest.approx(20.0, abs=1e-3)
    # climbing costs a little more than hovering; coming down nothing less
    assert found.battery == pytest.approx(found.duration_s / 240.0, rel=0.03)
    assert found.answer.startswith("Mission m: 1 min 28 s in the air, 20 m, up to 10 m high and 0 m away")
    assert found.notes == ()
    tired = PlannedVehicle("small", QUADROTOR, Endurance(1.8, 1.5, 4, 0.25, reserve=0.3))
    (note,) = outlook(mission(shapes=[hover]), tired).notes
    assert note.startswith("takes 8") or note.startswith("takes 9")
    assert "30 % are to be left" in note
