"""Expected values: the WMM2020 coefficients themselves, and what PX4 v1.16 reports for real flights."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusetune.ekf2.numerics import world_magnetic_model as wmm
from fusetune.ekf2.numerics import world_magnetic_model_table as table


def test_the_shipped_grid_is_what_the_coefficients_give():
    shipped, computed = table.read_tables(), table.compute_tables()
    for quantity in table.QUANTITIES:
        assert shipped[quantity].scale == computed[quantity].scale
        np.testing.assert_array_equal(shipped[quantity].values, computed[quantity].values)


def test_tables_survive_writing_and_reading(tmp_path):
    tables = table.read_tables()
    table.write_tables(tables, tmp_path / "tables.csv")
    for quantity, read in table.read_tables(tmp_path / "tables.csv").items():
        assert read.scale == tables[quantity].scale
        np.testing.assert_array_equal(read.values, tables[quantity].values)


@pytest.mark.parametrize("flight", ["JAParedes__TestFlight1", "SkyRats__log_8_2021-8-12-15-53-14"])
def test_px4_looked_up_the_same_field(shared_reference, flight):
    pq = pytest.importorskip("pyarrow.parquet")
    folder = shared_reference / flight / "deep"
    status = pq.read_table(folder / "estimator_status.parquet")
    place = pq.read_table(folder / "vehicle_local_position.parquet")
    inclination = np.array(status["mag_inclination_ref_deg"])[-1]
    strength = np.array(status["mag_strength_ref_gs"])[-1]
    # it was looked up at the first position, which is where the origin was put
    lat, lon = np.array(place["ref_lat"])[-1], np.array(place["ref_lon"])[-1]
    assert wmm.get_mag_inclination_degrees(lat, lon) == pytest.approx(inclination, abs=2e-5)
    assert wmm.get_mag_strength_gauss(lat, lon) == pytest.approx(strength, abs=1e-7)


def test_px4_reset_its_earth_field_to_the_same_declination(shared_reference):
    """On this flight the earth field states are set to the model's vector in one update, before anything is fused."""
    pq = pytest.importorskip("pyarrow.parquet")
    folder = shared_reference / "erdemarslan380__sitl_max_80" / "deep"
    states = pq.read_table(folder / "estimator_states.parquet")
    place = pq.read_table(folder / "vehicle_local_position.parquet")
    lat, lon = np.array(place["ref_lat"])[-1], np.array(place["ref_lon"])[-1]
    field = np.column_stack([np.array(states[f"states[{i}]"]) for i in (16, 17, 18)])
    strength = np.linalg.norm(field, axis=1)
    at_reset = np.flatnonzero(np.abs(strength - wmm.get_mag_strength_gauss(lat, lon)) < 1e-6)
    assert at_reset.size > 0
    declination = math.degrees(math.atan2(field[at_reset[0], 1], field[at_reset[0], 0]))
    assert wmm.get_mag_declination_degrees(lat, lon) == pytest.approx(declination, abs=1e-4)


@settings(deadline=None)
@given(st.floats(-90.0, 90.0), st.floats(-180.0, 180.0))
def test_longitude_wraps_once(lat, lon):
    for look_up in (wmm.get_mag_inclination_degrees, wmm.get_mag_strength_gauss):
        assert look_up(lat, lon + 360.0) == pytest.approx(look_up(lat, lon), rel=1e-9, abs=1e-9)


@settings(deadline=None)
@given(st.floats(-89.0, 89.0), st.floats(-179.0, 179.0))
def test_interpolation_stays_between_the_corners(lat, lon):
    strength = table.read_tables()["strength"]
    row, column = int((lat + 90.0) // 10.0), int((lon + 180.0) // 10.0)
    corners = strength.values[row : row + 2, column : column + 2] * strength.scale * 1e-5
    assert corners.min() - 1e-12 <= wmm.get_mag_strength_gauss(lat, lon) <= corners.max() + 1e-12


def test_a_grid_point_has_its_own_value():
    inclination = table.read_tables()["inclination"]
    assert wmm.get_mag_inclination_degrees(40.0, -80.0) == pytest.approx(inclination.values[13, 10] * inclination.scale)


def test_nowhere_has_no_field():
    assert math.isnan(wmm.get_mag_declination_degrees(math.nan, 0.0))
    assert math.isnan(wmm.get_mag_strength_gauss(0.0, math.inf))
