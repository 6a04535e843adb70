"""Missions made for a purpose: what they fly, and that it tells what they are for."""

from __future__ import annotations

import numpy as np
import pytest

from fusetune.analyze.flight.excitation import excitation
from fusetune.design.missions.asked_mission import asked_mission
from fusetune.design.missions.flown_path import flown_path
from fusetune.design.missions.limits import PX4_LIMITS
from fusetune.design.missions.outlook import PlannedMotion, attitude_of, motion_of
from fusetune.design.missions.purpose import BRISK_M_S2, DELAY_MS, MOTIONS, TURNING_DEG_S, motions_for
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS

HOME = (47.4, 8.5, 400.0)


def flown(*parameters: str, **keys: float) -> PlannedMotion:
    return motion_of(flown_path(asked_mission(None, (), parameters, HOME, **keys), PX4_LIMITS))


@pytest.mark.parametrize("field_m", [30.0, 60.0, 150.0])
def test_a_flight_for_the_delay_tells_it_as_closely_as_it_aims_at(field_m: float) -> None:
    motion = flown("EKF2_GPS_DELAY", field_m=field_m)
    # σ / √(N a²) with 0.3 m/s at 5 Hz
    told_ms = 1e3 * 0.3 / np.sqrt(5.0 * np.trapezoid(np.sum(motion.acceleration[:, :2] ** 2, axis=1), motion.time_s))
    assert told_ms <= 1.1 * DELAY_MS
    assert np.abs(motion.position[:, :2]).max() <= 0.5 * field_m + 1e-6


def test_a_flight_for_lever_arms_turns_enough_and_one_for_the_delay_is_brisk() -> None:
    for motion, brisk in ((flown("EKF2_GPS_POS_X"), False), (flown("EKF2_GPS_DELAY"), True)):
        time_us = (1e6 * motion.time_s).astype(np.int64)
        moved = excitation(time_us, motion.velocity, attitude_of(motion), [(int(time_us[0]), int(time_us[-1]))])
        assert moved is not None
        if brisk:
            assert moved.horizontal_acceleration_m_s2 > BRISK_M_S2
        else:
            assert moved.yaw_rate_deg_s > TURNING_DEG_S


def test_what_is_to_be_told_apart_is_flown_where_only_one_of_them_shows() -> None:
    told = motions_for(("EKF2_GPS_DELAY", "EKF2_ACC_NOISE"))
    assert told == {"hover": ("EKF2_ACC_NOISE",), "shuttle": ("EKF2_GPS_DELAY", "EKF2_ACC_NOISE")}


def test_the_motions_name_parameters_that_there_are() -> None:
    for motion in MOTIONS.values():
        for one in motion.parameters:
            assert any(motion.tells(name) for name in PARAMETERS if name.startswith(one.rstrip("*"))), one
