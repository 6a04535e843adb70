"""Positions and heights brought to the times of the velocity."""

import numpy as np

from fusetune.analyze.smoothing.measured_positions import MeasuredPositions


def test_what_lies_around_an_epoch_is_averaged_and_what_lies_beyond_left_out() -> None:
    """Epochs at 100, 200 and 400: between 50 and 150, 150 and 300, 300 and 500."""
    time = np.array([40, 60, 149, 150, 299, 310, 499, 500])
    values = np.array([9.0, 1.0, 3.0, 4.0, 6.0, 7.0, 9.0, 99.0])[:, None]
    found = MeasuredPositions("baro_hgt", False, time, values).at(np.array([100, 200, 400]))
    # means 2, 5 and 8, less their own mean
    np.testing.assert_allclose(found.values[:, 0], [-3.0, 0.0, 3.0])
    assert (found.source, found.axes, found.is_delayed) == ("baro_hgt", (2,), False)


def test_an_epoch_without_a_measurement_has_none() -> None:
    found = MeasuredPositions("gnss_pos", True, np.array([100, 300]), np.array([[1.0, 5.0], [3.0, 9.0]]))
    values = found.at(np.array([100, 200, 300])).values
    np.testing.assert_allclose(values[[0, 2]], [[-1.0, -2.0], [1.0, 2.0]])
    assert np.isnan(values[1]).all()
