from __future__ import annotations

import numpy as np
import pytest
from tests.analyze.sensor_noise.made_sensors import (
    AIRBORNE,
    END_S,
    LANDING_S,
    START_US,
    TAKE_OFF_S,
    made_flight,
    made_topics,
)

from fusetune.analyze.sensor_noise.sensor_series import sensor_series
from fusetune.analyze.sensor_noise.standing_still import standing_still
from fusetune.px4.flight import TopicKey, TopicTable


def still_s(topics: dict[TopicKey, TopicTable]) -> list[tuple[float, float]]:
    flight = made_flight(topics)
    series = sensor_series(flight)
    found = standing_still(flight, series["gyro"], series["accel"], AIRBORNE)
    return [((start - START_US) * 1e-6, (stop - START_US) * 1e-6) for start, stop in found]


@pytest.fixture
def topics() -> dict[TopicKey, TopicTable]:
    return made_topics(np.random.default_rng(1))


def test_before_arming_and_after_disarming(topics: dict[TopicKey, TopicTable]) -> None:
    before, after = still_s(topics)
    # armed from 2 s before take-off to 2 s after landing; a second more is kept clear; windows are half a second
    assert before == pytest.approx((0.0, TAKE_OFF_S - 3.0), abs=0.5)
    assert after == pytest.approx((LANDING_S + 3.0, END_S), abs=0.5)


def test_not_while_it_is_carried(topics: dict[TopicKey, TopicTable]) -> None:
    imu = topics["sensor_combined", 0]
    at = (imu["timestamp"] - START_US) * 1e-6
    carried = (at >= 5.0) & (at < 9.0)
    imu["gyro_rad[1]"] = imu["gyro_rad[1]"] + np.where(carried, 0.3 * np.sin(8.0 * at), 0.0).astype(np.float32)
    first, second, _ = still_s(topics)
    assert first[1] == pytest.approx(5.0, abs=0.5)
    assert second[0] == pytest.approx(9.0, abs=0.5)


def test_not_while_it_is_tilted_slowly(topics: dict[TopicKey, TopicTable]) -> None:
    imu = topics["sensor_combined", 0]
    at = (imu["timestamp"] - START_US) * 1e-6
    tilted = np.clip((at - 6.0) / 4.0, 0.0, 1.0) * 0.5
    imu["accelerometer_m_s2[0]"] = imu["accelerometer_m_s2[0]"] + (9.81 * np.sin(tilted)).astype(np.float32)
    found = still_s(topics)
    assert not any(start < 9.0 and stop > 7.0 for start, stop in found)


def test_a_gap_ends_a_stretch(topics: dict[TopicKey, TopicTable]) -> None:
    imu = topics["sensor_combined", 0]
    at = (imu["timestamp"] - START_US) * 1e-6
    topics["sensor_combined", 0] = {name: one[(at < 8.1) | (at > 8.3)] for name, one in imu.items()}
    first, second, _ = still_s(topics)
    assert first[1] == pytest.approx(8.0, abs=0.5)
    assert second[0] == pytest.approx(8.5, abs=0.5)


def test_what_is_stuck_does_not_stand_still(topics: dict[TopicKey, TopicTable]) -> None:
    imu = topics["sensor_combined", 0]
    for axis in range(3):
        imu[f"gyro_rad[{axis}]"] = np.zeros_like(imu[f"gyro_rad[{axis}]"])
    assert still_s(topics) == []


def test_a_log_that_shakes_throughout_has_no_quiet_part(topics: dict[TopicKey, TopicTable]) -> None:
    imu = topics["sensor_combined", 0]
    for axis in range(3):
        imu[f"accelerometer_m_s2[{axis}]"] = imu[f"accelerometer_m_s2[{axis}]"] * np.float32(40.0)
    assert still_s(topics) == []
