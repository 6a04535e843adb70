"""Commands as releases until v1.15 take them.

Expected: metres on a sphere of 6 371 000 m, by hand.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.ekf2.filter.aiding_estimator import START_US
from tests.ekf2.releases.test_named_behaviours import Flying, asked, flying

from fusetune.ekf2.feed.inputs import COMMAND, COMMAND_EXTERNAL_POSITION_ESTIMATE, COMMAND_SET_GPS_GLOBAL_ORIGIN
from fusetune.ekf2.replay import commands

RADIUS = 6_371_000.0
V113, V114, V115 = "v1.13", "v1.14", "v1.15"


def command(kind: int, *param: float) -> np.void:
    made = np.zeros(1, COMMAND)
    made["timestamp"], made["command"], made["param"] = START_US, kind, (*param, *[0.0] * (7 - len(param)))
    return made.view(np.recarray)[0]


def at_origin(release: str) -> Flying:
    """Aided by GNSS, 10 m above an origin at sea level on the equator."""
    it = flying(release)
    it.ekf["origin"]["lat_lon_valid"] = it.ekf["origin"]["valid"] = True
    it.ekf["origin"]["alt"] = 0.0
    it.ekf["cs"]["gnss_pos"] = it.ekf["cs"]["gnss_vel"] = True
    return it


@pytest.mark.parametrize("release", [V113, V114, V115])
def test_the_vehicle_stays_where_it_is_when_the_origin_moves(release):
    it = at_origin(release)
    it.ekf["cs"]["in_air"] = False
    it.ekf["gps_hgt_b_est"]["bias"] = 0.7
    asked(commands.handle_command, it, it.params, command(COMMAND_SET_GPS_GLOBAL_ORIGIN, 0, 0, 0, 0, 0.001, 0.0, 30.0))
    assert math.isclose(it.ekf["local"]["north"], -RADIUS * math.radians(0.001), rel_tol=1e-6)
    assert it.ekf["gpos_alt"] == 10.0 - 30.0
    assert it.ekf["state_reset"]["pos_ne_counter"] == it.ekf["state_reset"]["pos_d_counter"] == 1
    if release != V113:
        assert it.ekf["gps_hgt_b_est"]["bias"] == 0.7
    assert np.isfinite(it.ekf["mag"]["wmm_declination"]) == (release == V115)


@pytest.mark.parametrize(("release", "taken"), [(V113, False), (V114, True), (V115, True)])
def test_v1_13_moves_the_origin_on_the_ground_alone(release, taken):
    it = at_origin(release)
    asked(commands.handle_command, it, it.params, command(COMMAND_SET_GPS_GLOBAL_ORIGIN, 0, 0, 0, 0, 0.001, 0.0, 30.0))
    assert (it.ekf["origin"]["alt"] == 30.0) == taken


@pytest.mark.parametrize(("release", "taken"), [(V113, False), (V114, False), (V115, True)])
def test_v1_15_resets_to_a_position_that_is_given_while_dead_reckoning(release, taken):
    it = at_origin(release)
    it.ekf["vel"] = 3.0, 0.0, 0.0
    given = command(COMMAND_EXTERNAL_POSITION_ESTIMATE, 0, 2.0, 5.0, 0, 0.001, 0.0)
    asked(commands.handle_command, it, it.params, given)
    assert it.ekf["local"]["north"] == 0.0
    it.ekf["cs"]["inertial_dead_reckoning"] = True
    asked(commands.handle_command, it, it.params, given)
    expected = RADIUS * math.radians(0.001) + 3.0 * 2.0 if taken else 0.0
    assert math.isclose(it.ekf["local"]["north"], expected, rel_tol=1e-6)
    if taken:
        assert it.ekf["P"][6, 6] == 25.0
