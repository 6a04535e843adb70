"""A state that the vehicle logged, in the memory of releases until v1.15.

Expected: products by hand, of the logged state in v1.16's terms.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from tests.ekf2.releases.test_named_behaviours import flying

from fusetune.ekf2.feed.sensor_samples import GNSS_SAMPLE
from fusetune.ekf2.filter.common.state import ACCEL_BIAS, GYRO_BIAS, MAG_BODY, MAG_EARTH, TERRAIN
from fusetune.ekf2.filter.quaternion_core.quaternion_covariance import attitude_variance_about
from fusetune.ekf2.numerics.world_magnetic_model import field_at
from fusetune.ekf2.replay.older_start import (
    place_of,
    position_of_output,
    put_local_position,
    settle_core,
    settle_field,
    settle_samples,
)


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


@pytest.mark.parametrize("release", ["v1.13", "v1.14"])
def test_samples_that_wait_are_placed_about_the_origin(release):
    """A thousandth of a degree of latitude is 6 371 000 m · π / 180 000 on PX4's sphere; without a fix it is none."""
    ekf = flying(release).ekf
    ekf["origin"]["lat_rad"], ekf["origin"]["lon_rad"], ekf["origin"]["lat_lon_valid"] = *np.radians([47.0, 8.0]), True
    ekf["time_delayed_us"], ekf["time_latest_us"] = 5_000_000, 5_100_000
    gnss = np.zeros(260, GNSS_SAMPLE)
    gnss["time_us"] = 200_000 * np.arange(260) - 46_000_000
    gnss["lat_deg"], gnss["lon_deg"], gnss["fix_type"] = 47.001, 8.0, 3
    gnss["fix_type"][255] = 2
    settle_samples(ekf, SimpleNamespace(arrays=SimpleNamespace(gnss=gnss)))
    north = 6_371_000.0 * np.pi / 180_000.0
    positions = ekf["gnss_arrivals"]["positions"]
    assert np.allclose(positions[[254, 0, 3]], [north, 0.0], atol=1e-6)
    assert positions[255].tolist() == [0.0, 0.0]
    assert not np.any(positions[10:200])


def test_the_heading_is_measured_less_the_body_field_that_the_vehicle_knew():
    ekf = flying("v1.14").ekf
    ekf["origin"]["lat_rad"], ekf["origin"]["lon_rad"], ekf["origin"]["lat_lon_valid"] = *np.radians([47.0, 8.0]), True
    ekf["time_delayed_us"], ekf["cs"]["mag"] = 5_000_000, True
    body, earth = np.array([0.01, -0.02, 0.03]), np.array([0.2, 0.01, 0.4])
    state = SimpleNamespace(mag_earth=earth, mag_body=body, flags=frozenset({"mag_hdg"}))
    settle_field(ekf, "v1.14", state, is_known=False)
    assert np.allclose(ekf["mag_B"], body)
    assert np.allclose(ekf["mag_I"], earth)
    assert not ekf["cs"]["mag"]
    assert not ekf["field_history"]["declination_fused"]
    assert ekf["mag"]["wmm_declination"] == field_at(47.0, 8.0, "v1.14")[0] != field_at(47.0, 8.0)[0]
    # nothing is known of the field: the earth's is what is measured
    ekf["mag"]["lpf"], ekf["R_to_earth"] = [0.1, 0.2, 0.3], np.eye(3)
    settle_field(ekf, "v1.14", SimpleNamespace(mag_earth=np.zeros(3), mag_body=np.zeros(3), flags=()), is_known=False)
    assert np.allclose(ekf["mag_I"], [0.1, 0.2, 0.3])


@pytest.mark.parametrize("is_known", [False, True])
def test_a_field_that_is_fused_goes_on_being_fused(is_known):
    ekf = flying("v1.15").ekf
    ekf["origin"]["lat_lon_valid"] = True
    state = SimpleNamespace(mag_earth=np.zeros(3), mag_body=np.zeros(3), flags=())
    settle_field(ekf, "v1.15", state, is_known=is_known)
    history = ekf["field_history"]
    assert history["declination_fused"] == is_known
    # older than any fusion, so that it resets nothing; but known
    assert history["wmm_time_last_set"] == 1
    assert history["resets_available"] == 2
    settle_field(flying("v1.16").ekf, "v1.16", state, is_known=is_known)
