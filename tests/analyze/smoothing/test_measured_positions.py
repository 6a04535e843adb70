"""Positions and heights brought to the times of the velocity."""

import numpy as np

from fusetune.analyze.replaying.replayed_set import FilterStates, ReplayedSet
from fusetune.analyze.replaying.samples import AxisSamples
from fusetune.analyze.smoothing.measured_positions import MeasuredPositions, position_series
from fusetune.px4.flight import Flight


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


def test_heights_are_those_of_the_log_without_the_bias_that_the_filter_estimates() -> None:
    """A climb at 1 m/s; the filter takes the barometer less a bias that grows, 5 ms before it was logged."""
    time = np.arange(0, 20_000_000, 10_000, dtype=np.int64)
    ones = np.ones((time.size, 3))
    climbing = np.tile([0.0, 0.0, -1.0], (time.size, 1))
    states = FilterStates(time, np.tile([1.0, 0.0, 0.0, 0.0], (time.size, 1)), climbing, ones, ones, ones)
    taken = time[5:-5:5]
    seconds = (taken + 5_000) * 1e-6
    height = 488.0 + seconds + 0.1 * np.sin(seconds)
    bias, innovation = 0.05 * seconds, 0.01 * np.cos(seconds)
    many, fused = np.ones(taken.size), np.ones(taken.size, bool)
    sample = AxisSamples(taken, many, innovation, many, many, ~fused, fused, -(height - bias))
    record = ReplayedSet("present", {}, {}, {}, {("baro_hgt", 0): sample}, {}, {}, lambda: states)
    table = {"timestamp_sample": taken + 5_000, "baro_alt_meter": height}
    (logged,) = position_series(record, Flight("f", topics={("vehicle_air_data", 0): table}), "gnss_vel")
    (filtered,) = position_series(record, Flight("f"), "gnss_vel")
    # the height less the way climbed, 1 m/s for as long as the filter's clock says
    np.testing.assert_allclose(logged.values[:, 0], -(height - taken * 1e-6), atol=1e-9)
    np.testing.assert_allclose(filtered.values[:, 0] - logged.values[:, 0], bias, atol=1e-9)
    assert not logged.is_delayed
