"""Expected values: WGS 84 in Cartesian coordinates, and great circles on a sphere (haversine, azimuth)."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusetune.ekf2.numerics import geodesy

latitudes = st.floats(-1.4, 1.4)
longitudes = st.floats(-3.1, 3.1)
local = st.floats(-20_000.0, 20_000.0)


def ecef(lat, lon, alt):
    """WGS 84 geodetic to Cartesian, by semi-axes instead of PX4's eccentricity."""
    a, b = 6378137.0, 6356752.314245
    n = a * a / math.hypot(a * math.cos(lat), b * math.sin(lat))
    return np.array(
        [
            (n + alt) * math.cos(lat) * math.cos(lon),
            (n + alt) * math.cos(lat) * math.sin(lon),
            (b * b / (a * a) * n + alt) * math.sin(lat),
        ]
    )


@settings(deadline=None)
@given(latitudes, longitudes)
def test_a_step_east_covers_its_distance_on_the_ellipsoid(lat, lon):
    lat_b, lon_b = geodesy.add_to_lat_lon(lat, lon, 500.0, 0.0, 10.0)
    assert lat_b == lat
    assert np.linalg.norm(ecef(lat_b, lon_b, 500.0) - ecef(lat, lon, 500.0)) == pytest.approx(10.0, rel=1e-6)


@settings(deadline=None)
@given(latitudes, longitudes)
def test_a_step_north_is_px4s_which_is_shorter_by_the_flattening_term(lat, lon):
    lat_b, lon_b = geodesy.add_to_lat_lon(lat, lon, 0.0, 10.0, 0.0)
    w = 1.0 - (geodesy.WGS84_ECCENTRICITY * math.sin(lat)) ** 2
    # dividing by w^2.5 instead of w^1.5 makes PX4's radius larger, so the latitude changes by w less
    assert np.linalg.norm(ecef(lat_b, lon_b, 0.0) - ecef(lat, lon, 0.0)) == pytest.approx(10.0 * w, rel=1e-6)


@settings(deadline=None)
@given(latitudes, longitudes, st.floats(-100.0, 100.0), st.floats(-100.0, 100.0))
def test_difference_undoes_a_step(lat, lon, north, east):
    lat_b, lon_b = geodesy.add_to_lat_lon(lat, lon, 100.0, north, east)
    back = geodesy.lat_lon_difference(lat_b, lon_b, 100.0, lat, lon)
    # the radii are taken at the other end, where they differ by the step over the radius of the Earth, times tan(lat)
    np.testing.assert_allclose(back, (north, east), atol=2e-2)


def test_difference_goes_the_short_way_round_the_date_line():
    _, east = geodesy.lat_lon_difference(0.0, -math.pi + 1e-6, 0.0, 0.0, math.pi - 1e-6)
    assert east == pytest.approx(2e-6 * 6378137.0, rel=1e-6)


@settings(deadline=None)
@given(latitudes, longitudes, local, local)
def test_projection_keeps_distance_and_bearing_of_the_great_circle(lat, lon, north, east):
    lat_b, lon_b = geodesy.reproject(lat, lon, north, east)
    half_lat, half_lon = 0.5 * (lat_b - lat), 0.5 * (lon_b - lon)
    haversine = math.sin(half_lat) ** 2 + math.cos(lat) * math.cos(lat_b) * math.sin(half_lon) ** 2
    distance = 2.0 * 6371000.0 * math.asin(math.sqrt(haversine))
    assert distance == pytest.approx(math.hypot(north, east), abs=1e-3)
    if distance > 1.0:
        bearing = math.atan2(
            math.sin(lon_b - lon) * math.cos(lat_b),
            math.cos(lat) * math.sin(lat_b) - math.sin(lat) * math.cos(lat_b) * math.cos(lon_b - lon),
        )
        assert math.cos(bearing - math.atan2(east, north)) == pytest.approx(1.0, abs=1e-6)


@settings(deadline=None)
@given(latitudes, longitudes, local, local)
def test_projection_undoes_reprojection(lat, lon, north, east):
    back = geodesy.project(lat, lon, *geodesy.reproject(lat, lon, north, east))
    np.testing.assert_allclose(back, (north, east), atol=1e-3)


def test_projection_of_the_reference_is_the_origin():
    assert geodesy.project(0.7, -1.2, 0.7, -1.2) == (0.0, 0.0)
    assert geodesy.reproject(0.7, -1.2, 0.0, 0.0) == (0.7, -1.2)


def test_earth_rate_turns_about_the_polar_axis():
    at_pole = geodesy.earth_rate_ned(0.5 * math.pi)
    np.testing.assert_allclose(at_pole, (0.0, 0.0, -7.292115e-5), atol=1e-18)
    # one turn per sidereal day of 86164.1 s
    assert np.linalg.norm(geodesy.earth_rate_ned(0.6)) == pytest.approx(2.0 * math.pi / 86164.1, rel=1e-6)


@settings(deadline=None)
@given(latitudes, st.floats(-30.0, 30.0), st.floats(-30.0, 30.0))
def test_transport_rate_follows_from_the_rates_of_latitude_and_longitude(lat, vel_n, vel_e):
    alt = 300.0
    lat_b, lon_b = geodesy.add_to_lat_lon(lat, 0.0, alt, vel_n, vel_e)
    expected = (lon_b * math.cos(lat), -(lat_b - lat), -lon_b * math.sin(lat))
    np.testing.assert_allclose(geodesy.transport_rate(lat, alt, vel_n, vel_e), expected, atol=1e-12)
