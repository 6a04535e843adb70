"""Order of arrival: hand-made message times, the meaning of `ekf2_timestamps` worked out by hand."""

import numpy as np

from fusetune.ekf2.feed.arrival_order import schedule_runs
from fusetune.px4.flight import Flight

INVALID = 32767


def flight_with(imu, ekf2_timestamps=None):
    topics = {("sensor_combined", 0): {"timestamp": np.array(imu, dtype=np.int64)}}
    if ekf2_timestamps is not None:
        topics["ekf2_timestamps", 0] = {name: np.array(values) for name, values in ekf2_timestamps.items()}
    return Flight("hand_made", topics)


def test_without_ekf2_timestamps_messages_count_from_their_time_stamp():
    runs = schedule_runs(flight_with([1000, 2000, 3000, 4000]))
    assert runs.mode == "approx"
    newest = runs.newest_message("vehicle_air_data", np.array([500, 2000, 2500, 2900]))
    assert newest.tolist() == [0, 1, 3, -1]


def test_ekf2_timestamps_delay_a_message_until_the_run_that_had_it():
    logged = {
        "timestamp": [1000, 2000, 3000],
        "vehicle_air_data_timestamp_rel": [INVALID, INVALID, -15],
        "vehicle_magnetometer_timestamp_rel": [0, INVALID, INVALID],
    }
    runs = schedule_runs(flight_with([1000, 2000, 3000], logged))
    assert runs.mode == "timestamps"
    assert runs.newest_message("vehicle_air_data", np.array([1500])).tolist() == [-1, -1, 0]
    # 0.1 ms are cut off both times, so a message may be stamped up to 99 µs after what the difference says.
    assert runs.newest_message("vehicle_magnetometer", np.array([1099, 1100])).tolist() == [0, -1, -1]


def test_topics_that_ekf2_timestamps_does_not_name_count_from_their_time_stamp():
    runs = schedule_runs(flight_with([1000, 2000], {"timestamp": [1000, 2000]}))
    assert runs.newest_message("vehicle_gps_position", np.array([900, 1500, 1600])).tolist() == [0, 2]


def test_run_without_its_imu_sample_passes_its_messages_on_to_the_next():
    logged = {"timestamp": [1000, 2000, 3000], "vehicle_air_data_timestamp_rel": [INVALID, 0, INVALID]}
    runs = schedule_runs(flight_with([1000, 3000], logged))
    assert runs.timestamp.tolist() == [1000, 3000]
    assert runs.newest_message("vehicle_air_data", np.array([1900])).tolist() == [-1, 0]


def test_message_stamped_later_holds_up_those_behind_it():
    runs = schedule_runs(flight_with([1000, 2000, 3000]))
    assert runs.newest_message("vehicle_air_data", np.array([2500, 900])).tolist() == [-1, -1, 1]
