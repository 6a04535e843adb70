"""Points and sets of a search."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.apply.search.made_ground import PRESENT, SPACE

from fusetune.apply.search.space import Space
from fusetune.design.factors import factors_around
from fusetune.px4.parameters.ekf2_parameters import as_float32


def test_the_present_set_is_the_point_0_and_keeps_its_very_values() -> None:
    odd = {**PRESENT, "EKF2_GPS_V_NOISE": 0.31234, "EKF2_GPS_DELAY": 113.0}
    space = Space(factors_around(odd, tuple(odd)))
    assert space.values(np.zeros(4)) == {name: as_float32(value) for name, value in odd.items()}


@given(st.lists(st.floats(-1.5, 1.5), min_size=4, max_size=4))
def test_values_lie_inside_the_bounds_have_two_digits_and_delays_lie_on_their_grid(point: list[float]) -> None:
    values = SPACE.values(np.array(point))
    for factor, coordinate in zip(SPACE.factors, point, strict=True):
        value = values[factor.parameter]
        assert factor.low * (1 - 1e-6) <= value <= factor.high * (1 + 1e-6)
        if factor.grid:
            assert value % factor.grid == 0.0
        elif coordinate:
            at_a_bound = value in (as_float32(factor.low), as_float32(factor.high))
            assert at_a_bound or value == pytest.approx(float(f"{value:.2g}"), rel=1e-6)


def test_a_delay_that_the_buffers_do_not_hold_brings_a_longer_limit_along() -> None:
    # (150 + 10) ms × 1.25 = 200 ms, what PX4's default allows; (160 + 10) × 1.25 = 212.5, in tens 220
    space = Space(SPACE.factors, delay_max=200.0)
    assert space.whole({"EKF2_GPS_DELAY": 150.0}) == {"EKF2_GPS_DELAY": 150.0}
    assert space.whole({"EKF2_GPS_DELAY": 160.0}) == {"EKF2_GPS_DELAY": 160.0, "EKF2_DELAY_MAX": 220.0}
    assert space.whole({"EKF2_ACC_NOISE": 1.0}) == {"EKF2_ACC_NOISE": 1.0}
