"""A state that the vehicle logged, in the memory of releases until v1.15.

Expected: products by hand, of the logged state in v1.16's terms.
"""

from __future__ import annotations

import numpy as np
import pytest
from tests.ekf2.releases.test_named_behaviours import flying

from fusetune.ekf2.filter.common.state import ACCEL_BIAS, GYRO_BIAS, MAG_BODY, MAG_EARTH, TERRAIN
from fusetune.ekf2.filter.quaternion_core.quaternion_covariance import attitude_variance_about
from fusetune.ekf2.replay.older_start import place_of, position_of_output, put_local_position, settle_core, settle_field


def test_a_position_is_put_into_the_local_frame():
    ekf = flying("v1.15").ekf
    ekf["origin"]["lat_rad"], ekf["origin"]["lon_rad"], ekf["origin"]["lat_lon_valid"] = 0.5, 0.2, True
    put_local_position(ekf, np.array([10.0, -20.0, -30.0]))
    assert (ekf["local"]["north"], ekf["local"]["last_known_east"], ekf["gpos_alt"]) == (10.0, -20.0, 30.0)
    assert position_of_output(ekf).tolist() == [10.0, -20.0, -30.0]
    assert np.allclose(place_of(ekf), np.degrees([0.5, 0.2]))
    assert np.allclose(ekf["earth_rate_ned"], 7.292115e-5 * np.array([np.cos(0.5), 0.0, -np.sin(0.5)]))


def test_v1_16_keeps_where_it_is():
    ekf = flying("v1.16").ekf
    ekf["gpos_lat"], ekf["gpos_alt"] = 0.7, 488.0
    put_local_position(ekf, np.array([10.0, -20.0, -30.0]))
    assert ekf["gpos_lat"] == 0.7
    assert ekf["gpos_alt"] == 488.0
    assert position_of_output(ekf).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("release", ["v1.13", "v1.14"])
def test_variances_become_those_of_quaternion_and_increments(release):
    it = flying(release)
    ekf, variances = it.ekf, np.arange(1.0, 25.0) * 1e-3
    ekf["q"] = np.array([0.8, -0.3, 0.4, 0.33166248]) / np.linalg.norm([0.8, -0.3, 0.4, 0.33166248])
    ekf["P"], ekf["dt_ekf_avg"], ekf["gyro_bias"] = np.diag(variances), 0.008, 0.5
    settle_core(ekf, it.params)
    P = ekf["P"]
    assert np.allclose([attitude_variance_about(ekf, axis) for axis in range(3)], variances[:3])
    assert np.allclose(np.diag(P)[GYRO_BIAS : ACCEL_BIAS + 3], variances[GYRO_BIAS : ACCEL_BIAS + 3] * 0.008**2)
    assert np.allclose(ekf["quaternion"]["kept_accel_bias_var"], np.diag(P)[ACCEL_BIAS : ACCEL_BIAS + 3])
    assert np.allclose(ekf["gyro_bias"], 0.5 * 0.008)
    assert not np.any(P[MAG_EARTH : MAG_BODY + 3])
    assert np.allclose(ekf["mag_modes"]["saved_body_variance"], variances[MAG_BODY : MAG_BODY + 3])


def test_the_terrain_of_v1_15_is_uncertain_apart():
    it = flying("v1.15")
    settle_core(it.ekf, it.params)
    assert it.ekf["P"][TERRAIN, TERRAIN] == 0.0
    assert it.ekf["terrain_filter"]["variance"] == it.params["EKF2_MIN_RNG"] ** 2


@pytest.mark.parametrize("fused", [False, True])
def test_a_field_that_is_fused_goes_on_being_fused(fused):
    ekf = flying("v1.15").ekf
    ekf["cs"]["mag"], ekf["mag"]["wmm_declination"] = fused, 0.1
    settle_field(ekf)
    history = ekf["field_history"]
    assert history["declination_fused"] == fused
    # older than any fusion, so that it resets nothing; but known
    assert history["wmm_time_last_set"] == 1
    assert history["resets_available"] == 2
    settle_field(flying("v1.16").ekf)
