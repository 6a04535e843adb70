"""How a flight moved, against motions of which the figures follow by hand."""

import numpy as np
import pytest

from fusetune.analyze.flight.excitation import excitation
from fusetune.quaternions import from_rotation_vector

TIME = np.arange(0, 60_000_001, 10_000)
SECONDS = TIME * 1e-6
LEVEL = np.tile([1.0, 0.0, 0.0, 0.0], (TIME.size, 1))
ALL = [(0, 60_000_000)]


def motion(north=0.0, down=0.0, attitude=LEVEL, intervals=ALL):  # type: ignore[no-untyped-def]
    velocity = np.column_stack([np.broadcast_to(one, TIME.shape) for one in (north, 0.0, down)]).astype(float)
    found = excitation(TIME, velocity, attitude, intervals)
    assert found is not None
    return found


def test_a_sine_of_velocity_has_the_acceleration_of_its_chord() -> None:
    """sin over a second: the chord of A sin(ωt) over T is 2 A sin(ωT/2), RMS √2 A sin(ωT/2)."""
    found = motion(north=3.0 * np.sin(2 * np.pi * SECONDS / 10.0))
    assert found.horizontal_acceleration_m_s2 == pytest.approx(np.sqrt(2) * 3.0 * np.sin(np.pi / 10.0), rel=0.02)
    assert found.vertical_acceleration_m_s2 == 0.0


def test_turning_about_the_body_axes_is_told_apart() -> None:
    for axis, (tilting, turning) in ((0, (30.0, 0.0)), (2, (0.0, 30.0))):
        vector = np.zeros((TIME.size, 3))
        vector[:, axis] = np.radians(30.0) * SECONDS
        found = motion(attitude=from_rotation_vector(vector))
        assert found.roll_pitch_rate_deg_s == pytest.approx(tilting, abs=1e-6)
        assert found.yaw_rate_deg_s == pytest.approx(turning, abs=1e-6)
    assert found.turned_deg == pytest.approx(30.0 * 59.0, rel=0.02)


def test_climbs_add_up_whichever_way_and_hovering_is_a_share() -> None:
    """Half of the time at 1 m/s up, a quarter at 1 m/s down: 45 m; a quarter hovers."""
    down = np.select([SECONDS < 30.0, SECONDS < 45.0], [-1.0, 1.0], 0.0)
    found = motion(down=down)
    assert found.climbed_m == pytest.approx(45.0, rel=0.02)
    assert found.hover_share == pytest.approx(0.25, abs=0.01)


def test_only_the_scored_parts_count_and_what_is_too_short_tells_nothing() -> None:
    north = np.where(SECONDS < 30.0, 5.0 * np.sin(SECONDS), 0.0)
    assert motion(north=north, intervals=[(32_000_000, 60_000_000)]).horizontal_acceleration_m_s2 == 0.0
    assert excitation(TIME, np.zeros((TIME.size, 3)), LEVEL, [(0, 900_000)]) is None
    assert excitation(TIME[:0], np.zeros((0, 3)), LEVEL[:0], ALL) is None
