"""Places in the state vectors against those of PX4 v1.16: `state.h` and the layout of `estimator_states`."""

from __future__ import annotations

from fusetune.ekf2.filter.common import state


def test_places_in_the_error_state():
    assert (state.ATTITUDE, state.VELOCITY, state.POSITION, state.GYRO_BIAS, state.ACCEL_BIAS) == (0, 3, 6, 9, 12)
    assert (state.MAG_EARTH, state.MAG_BODY, state.WIND, state.TERRAIN, state.ERROR_STATE_SIZE) == (15, 18, 21, 23, 24)


def test_places_in_the_published_state():
    """The quaternion has one element more than the attitude error."""
    assert (state.PUBLISHED_VELOCITY, state.PUBLISHED_POSITION, state.PUBLISHED_GYRO_BIAS) == (4, 7, 10)
    assert (state.PUBLISHED_ACCEL_BIAS, state.PUBLISHED_MAG_EARTH, state.PUBLISHED_MAG_BODY) == (13, 16, 19)
    assert (state.PUBLISHED_WIND, state.PUBLISHED_TERRAIN, state.PUBLISHED_STATE_SIZE) == (22, 24, 25)
    assert state.PUBLISHED_QUATERNION == 0
