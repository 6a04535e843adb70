"""What several flights tell of a sensor's delay and place, by hand calculation."""

import numpy as np
import pytest

from fusetune.analyze.delays.lag import Lag
from fusetune.analyze.delays.pooled_place import pooled_place
from fusetune.analyze.delays.velocity_place import VelocityPlace


def place(delay_s: float, error_s: float, arm: tuple[float, float, float], errors: tuple[float, ...]) -> VelocityPlace:
    return VelocityPlace(Lag(delay_s, error_s, 1000, 300), np.array(arm), np.diag(np.square(errors)))


def test_flights_weigh_by_what_they_tell() -> None:
    """Errors of 1 and 2: weights 0.8 and 0.2, error √(1/(1 + 1/4)) = 0.894; the two are apart by less than that."""
    near = place(0.100, 0.010, (0.1, 0.0, 0.0), (0.01, 0.02, 0.03))
    far = place(0.105, 0.020, (0.11, 0.0, 0.0), (0.02, 0.04, 0.06))
    pooled = pooled_place([near, None, far])
    assert pooled is not None
    assert pooled.flights == 2
    assert pooled.delay_s == pytest.approx(0.101)
    assert pooled.delay_error_s == pytest.approx(0.00894, rel=1e-3)
    assert pooled.arm == pytest.approx([0.102, 0.0, 0.0])
    assert pooled.arm_error == pytest.approx(0.894 * np.array([0.01, 0.02, 0.03]), rel=1e-3)


def test_flights_that_differ_by_more_than_their_errors_are_less_sure() -> None:
    """±0.03 about their mean: of two values the error of the mean is half of what they are apart, 0.03."""
    pooled = pooled_place([place(0.13, 0.01, (0.0,) * 3, (0.01,) * 3), place(0.07, 0.01, (0.0,) * 3, (0.01,) * 3)])
    assert pooled is not None
    assert pooled.delay_s == pytest.approx(0.10)
    assert pooled.delay_error_s == pytest.approx(0.03)
    assert pooled.arm_error == pytest.approx([0.01 / 2.0**0.5] * 3)


def test_where_no_flight_tells_there_is_nothing() -> None:
    assert pooled_place([None, None]) is None
    assert pooled_place([]) is None
