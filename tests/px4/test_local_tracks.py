"""Places on PX4's local map, one at a time and many at once."""

import numpy as np
import pytest

from fusetune.px4.local_map import LocalMap
from fusetune.px4.local_tracks import all_to_local


def test_many_places_at_once_are_where_each_is() -> None:
    lat, lon = np.array([47.0, 47.2, -33.0]), np.array([8.0, 7.9, 151.0])
    one = LocalMap(47.0, 8.0)
    places = [one.to_local(*place) for place in zip(lat.tolist(), lon.tolist(), strict=True)]
    np.testing.assert_allclose(all_to_local(one, lat, lon), places, rtol=1e-12, atol=1e-9)
    assert all_to_local(one, [], []).shape == (0, 2)


def test_a_thousandth_of_a_degree_is_a_hundred_and_eleven_metres() -> None:
    """6371000 m · 0.001 · π / 180 to the north, and cos 47° of it to the east."""
    assert LocalMap(47.0, 8.0).to_local(47.001, 8.0) == pytest.approx((111.1949, 0.0), abs=1e-4)
    assert LocalMap(47.0, 8.0).to_local(47.0, 8.001)[1] == pytest.approx(75.8347, abs=1e-3)
