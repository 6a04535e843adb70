"""What the estimator is given of a flight: exact, and small, for a flight has a million IMU samples an hour."""

import numpy as np

from fusetune.ekf2.feed import inputs as estimator_inputs
from fusetune.ekf2.feed.inputs import (
    ARRIVAL,
    ARRIVAL_FIELDS,
    IMU_ROW,
    build_inputs,
    imu_samples,
    without_arrivals,
)
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
    # 250 samples a second for an hour: 43 MB
    assert IMU_ROW.itemsize * 250 * 3600 <= 44e6


def test_arrivals_of_a_flight_are_small(survey_flight: Flight) -> None:
    """Magnetometer 50, barometer 20, GNSS 5 and states of the vehicle a few times a second: 3 MB for an hour."""
    arrays = build_inputs(survey_flight).arrays
    seconds = float(np.ptp(arrays.imu["time_us"])) * 1e-6
    assert arrays.arrivals.nbytes / seconds < 1000
    assert np.all(np.diff(arrays.arrivals["run"]) >= 0)


def test_arrivals_can_be_left_out_by_field_and_run() -> None:
    names = ARRIVAL_FIELDS
    told = [(2, "mag", 0), (2, "gnss", 5), (3, "reset_gyro_bias", 1), (4, "mag", 1), (7, "command", 3)]
    arrivals = np.array([(run, names.index(name), position) for run, name, position in told], ARRIVAL)
    left = without_arrivals(arrivals, ("mag", "reset_gyro_bias"), np.arange(8) < 4)
    assert [(run, names[field]) for run, field, _ in left.tolist()] == [(2, "gnss"), (4, "mag"), (7, "command")]
