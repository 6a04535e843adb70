from __future__ import annotations

import numpy as np
import pytest
from tests.analyze.sensor_noise.made_sensors import END_S, START_US, imu_table, made_flight, made_topics, seconds, times

from fusetune.analyze.sensor_noise.sensor_series import sensor_series
from fusetune.px4.flight import TopicKey, TopicTable


@pytest.fixture
def topics() -> dict[TopicKey, TopicTable]:
    return made_topics(np.random.default_rng(1))


def test_every_sensor_that_is_logged(topics: dict[TopicKey, TopicTable]) -> None:
    found = sensor_series(made_flight(topics))
    assert set(found) == {"gyro", "accel", "mag", "baro"}
    assert {name: round(one.rate_hz) for name, one in found.items()} == {
        "gyro": 200,
        "accel": 200,
        "mag": 50,
        "baro": 20,
    }
    assert (found["gyro"].device_id, found["accel"].device_id, found["mag"].device_id) == (11, 12, 77)
    assert found["gyro"].averaged_s == pytest.approx(0.005)


def fifo_table(rng: np.random.Generator, device_id: int) -> TopicTable:
    """2 kHz in messages of ten of which the array could hold 32; scale 0.001, readings within ± 20."""
    at = seconds(200.0) + 9 * 0.0005
    table: TopicTable = {"timestamp": times(at) + 300, "timestamp_sample": times(at)}
    table |= {"device_id": np.full(len(at), device_id, np.uint32), "dt": np.full(len(at), 500.0, np.float32)}
    table |= {"scale": np.full(len(at), 1e-3, np.float32), "samples": np.full(len(at), 10, np.uint8)}
    for axis in "xyz":
        for place in range(32):
            filled = rng.integers(-20, 21, len(at)) if place < 10 else np.full(len(at), 30_000)
            table[f"{axis}[{place}]"] = filled.astype(np.int16)
    return table


def test_fifo_is_fuller_and_is_averaged_to_about_a_kilohertz(topics: dict[TopicKey, TopicTable]) -> None:
    topics["sensor_gyro_fifo", 0] = fifo_table(np.random.default_rng(2), 5)
    topics["sensor_gyro_fifo", 1] = table = fifo_table(np.random.default_rng(3), 11)
    gyro = sensor_series(made_flight(topics))["gyro"]
    assert gyro.topic == "sensor_gyro_fifo"
    assert gyro.rate_hz == pytest.approx(1000.0)
    # the first two readings of the first message of the device that was selected
    first = [np.mean([float(table[f"{axis}[{place}]"][0]) for place in (0, 1)]) * 1e-3 for axis in "xyz"]
    assert gyro.values[0] == pytest.approx(first)
    assert gyro.time[0] == START_US + 500
    assert np.abs(gyro.values).max() < 0.021


def test_increments_stand_in_for_what_is_thinned(topics: dict[TopicKey, TopicTable]) -> None:
    full = imu_table(np.random.default_rng(4))
    topics["sensor_combined", 0] = {name: one[::40] for name, one in topics["sensor_combined", 0].items()}
    interval = np.full(len(full["timestamp"]), 4800, np.uint16)
    topics["vehicle_imu", 0] = {
        "timestamp": full["timestamp"],
        "timestamp_sample": full["timestamp"],
        "gyro_device_id": np.full(len(interval), 11, np.uint32),
        "accel_device_id": np.full(len(interval), 12, np.uint32),
        "delta_angle_dt": interval,
        "delta_velocity_dt": interval,
        **{f"delta_angle[{i}]": full[f"gyro_rad[{i}]"] * np.float32(0.0048) for i in range(3)},
        **{f"delta_velocity[{i}]": full[f"accelerometer_m_s2[{i}]"] * np.float32(0.0048) for i in range(3)},
    }
    gyro = sensor_series(made_flight(topics))["gyro"]
    assert gyro.topic == "vehicle_imu"
    assert gyro.averaged_s == pytest.approx(0.0048)
    assert gyro.values[:, 0] == pytest.approx(full["gyro_rad[0]"], abs=1e-6)


def test_gnss_in_metres_about_its_place(topics: dict[TopicKey, TopicTable]) -> None:
    at = seconds(5.0)
    steps = np.where(np.arange(len(at)) % 2, 0.5, -0.5)
    topics["vehicle_gps_position", 0] = {
        "timestamp": times(at),
        "timestamp_sample": times(at),
        "fix_type": np.where(at < 3.0, 2, 3).astype(np.uint8),
        # a degree of latitude is 6371 km · π / 180 = 111.195 km, of longitude at 60° half of that
        "latitude_deg": 60.0 + steps / 111_194.93,
        "longitude_deg": 10.0 + 2.0 * steps / 111_194.93,
        "altitude_msl_m": 50.0 - steps,
        "s_variance_m_s": np.full(len(at), 0.2, np.float32),
        "eph": np.full(len(at), 0.9, np.float32),
        "epv": np.full(len(at), 1.5, np.float32),
        "satellites_used": np.full(len(at), 12, np.uint8),
        **{f"vel_{axis}_m_s": np.full(len(at), 0.1, np.float32) for axis in "ned"},
    }
    found = sensor_series(made_flight(topics))
    assert len(found["gnss_pos"].time) == np.count_nonzero(at >= 3.0)
    north, east, down = (np.ptp(found["gnss_pos"].values[:, axis]) for axis in range(3))
    assert (north, east, down) == pytest.approx((1.0, 1.0, 1.0), abs=1e-3)


def test_a_clock_that_goes_back_adds_no_samples(topics: dict[TopicKey, TopicTable]) -> None:
    imu = topics["sensor_combined", 0]
    imu["timestamp"] = np.where(
        np.arange(len(imu["timestamp"])) >= 4000, imu["timestamp"] - 5_000_000, imu["timestamp"]
    )
    gyro = sensor_series(made_flight(topics))["gyro"]
    assert (np.diff(gyro.time) > 0).all()
    assert len(gyro.time) == round((END_S - 5.0) * 200)


def test_pieces_end_at_gaps(topics: dict[TopicKey, TopicTable]) -> None:
    imu = topics["sensor_combined", 0]
    kept = np.arange(len(imu["timestamp"])) // 100 != 5
    topics["sensor_combined", 0] = {name: one[kept] for name, one in imu.items()}
    gyro = sensor_series(made_flight(topics))["gyro"]
    pieces = gyro.pieces([(START_US, START_US + 10_000_000)], 1.0)
    assert [len(one) for one in pieces] == [500, 1400]
