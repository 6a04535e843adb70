"""What the estimator is given of a flight: exact, and small, for a flight has a million IMU samples an hour."""

import numpy as np

from fusetune.ekf2.feed import inputs as estimator_inputs
from fusetune.ekf2.feed.inputs import ARRIVALS, IMU_ROW, build_inputs, imu_samples
from fusetune.ekf2.feed.message_samples import imu_samples as wide_samples
from fusetune.px4.flight import Flight


def test_imu_rows_hold_the_samples_exactly_at_half_their_size(survey_flight: Flight, monkeypatch) -> None:
    monkeypatch.setattr(estimator_inputs, "IMU_ROWS_AT_ONCE", 1000)
    inputs = build_inputs(survey_flight)
    wide = wide_samples(survey_flight.topics["sensor_combined", 0])
    rows = np.searchsorted(wide["time_us"], inputs.arrays.imu["time_us"])
    found = imu_samples(inputs.arrays.imu)
    assert len(found) > 20_000
    for name in wide.dtype.names or ():
        np.testing.assert_array_equal(found[name], wide[name][rows])
    assert IMU_ROW.itemsize * 2 <= wide.dtype.itemsize
    # 250 samples a second for an hour: 83 MB
    assert (IMU_ROW.itemsize + ARRIVALS.itemsize) * 250 * 3600 <= 85e6


def test_a_stretch_has_the_samples_of_its_runs(survey_flight: Flight) -> None:
    arrays = build_inputs(survey_flight).arrays
    stretch = arrays.of_runs(300, 500)
    assert len(stretch.imu) == len(stretch.arrivals) == 200
    np.testing.assert_array_equal(stretch.imu["time_us"], arrays.imu["time_us"][300:500])
    # positions in the other arrays hold in every stretch
    np.testing.assert_array_equal(stretch.arrivals["baro"], arrays.arrivals["baro"][300:500])
    assert stretch.baro is arrays.baro
