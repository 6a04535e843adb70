"""Places in the state vectors against those of PX4 v1.16: `state.h` and the layout of `estimator_states`."""

from __future__ import annotations

import numpy as np

from fusetune.ekf2.filter.common import state
from fusetune.ekf2.filter.common.core_memory import CORE_MEMORY, zeros_on_cache_lines
from fusetune.ekf2.filter.estimator import EKF


def test_places_in_the_error_state():
    assert (state.ATTITUDE, state.VELOCITY, state.POSITION, state.GYRO_BIAS, state.ACCEL_BIAS) == (0, 3, 6, 9, 12)
    assert (state.MAG_EARTH, state.MAG_BODY, state.WIND, state.TERRAIN, state.ERROR_STATE_SIZE) == (15, 18, 21, 23, 24)


def test_places_in_the_published_state():
    """The quaternion has one element more than the attitude error."""
    assert (state.PUBLISHED_VELOCITY, state.PUBLISHED_POSITION, state.PUBLISHED_GYRO_BIAS) == (4, 7, 10)
    assert (state.PUBLISHED_ACCEL_BIAS, state.PUBLISHED_MAG_EARTH, state.PUBLISHED_MAG_BODY) == (13, 16, 19)
    assert (state.PUBLISHED_WIND, state.PUBLISHED_TERRAIN, state.PUBLISHED_STATE_SIZE) == (22, 24, 25)
    assert state.PUBLISHED_QUATERNION == 0


def test_rows_of_the_covariance_begin_with_cache_lines():
    """64 bytes on x86-64 and most ARM; a row of 24 doubles takes three."""
    for dtype in (CORE_MEMORY, EKF):
        records = [zeros_on_cache_lines(dtype) for _ in range(5)]
        assert {record["P"].ctypes.data % 64 for record in records} == {0}
        assert records[0].dtype == dtype
        assert records[0].shape == (1,)
        assert not np.frombuffer(records[0].tobytes(), np.uint8).any()
