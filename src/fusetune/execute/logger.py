"""The vehicle's logger: what of a flight gets into the log."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusetune.execute.noise import random_stream
from fusetune.execute.sensors.faults import DefaultProfile, Fault, LoggerDropout, of_kind
from fusetune.execute.world.flight_plan import FlightEvents
from fusetune.px4.estimator_samples import RELATIVE_FIELDS, RELATIVE_TICK_US, RELATIVE_TIMESTAMP_INVALID
from fusetune.px4.flight import Dropout, TopicKey, TopicTable, select_rows

NO_SAMPLE = RELATIVE_TIMESTAMP_INVALID
ESTIMATOR_LATENCY_US = 450
"""From the end of an IMU sample to the run of the estimator that takes it."""
LONGEST_LOSS = 4
"""A busy logger loses up to this many IMU samples in a row."""
RELATIVE_TIMESTAMPS = dict(sorted((field, topic) for topic, field in RELATIVE_FIELDS.items()))
"""Fields of `ekf2_timestamps`, in the order of the message, and the topics whose messages they name."""

DEFAULT_INTERVAL_MS = {
    "vehicle_magnetometer": 500,
    "vehicle_air_data": 200,
    "vehicle_gps_position": 100,
    "distance_sensor": 1000,
    "vehicle_optical_flow": 500,
    "airspeed": 1000,
    "airspeed_validated": 200,
    "vehicle_imu_status": 1000,
    "actuator_motors": 100,
    "vehicle_thrust_setpoint": 20,
    "battery_status": 200,
    "vehicle_attitude": 50,
    "vehicle_local_position": 100,
    "estimator_states": 1000,
    "estimator_status": 200,
    "estimator_sensor_bias": 1000,
    "estimator_innovations": 500,
    "estimator_innovation_variances": 500,
    "estimator_innovation_test_ratios": 500,
}
"""Smallest time between two logged messages of a topic in PX4 v1.16's default profile, ms."""
AID_SOURCE_INTERVAL_MS = 100

REPLAY_PROFILE_INTERVAL_MS = {
    "vehicle_attitude": 20,
    "vehicle_local_position": 20,
    "estimator_states": 100,
    "estimator_status": 200,
    "estimator_sensor_bias": 1000,
    "estimator_innovations": 100,
    "estimator_innovation_variances": 100,
    "estimator_innovation_test_ratios": 100,
}
"""The same when the profile for estimator replay is on: sensors and aid sources at full rate, the rest often enough."""
SLOW_TOPIC_INTERVAL_US = 400_000
REPLAY_ONLY_TOPICS = ("ekf2_timestamps", "vehicle_visual_odometry")


def ekf2_timestamps(topics: dict[TopicKey, TopicTable]) -> TopicTable:
    """Which sample each run of the estimator took, as PX4 logs it for replay.

    One row per IMU sample. A run takes a sample once it is published; its time is told relative to that of the IMU in
    steps of 0.1 ms, computed from times that were cut to 0.1 ms.
    """
    imu_us = topics["sensor_combined", 0]["timestamp"]
    table: TopicTable = {"timestamp": imu_us.copy()}
    for column, topic in RELATIVE_TIMESTAMPS.items():
        relative = np.full(len(imu_us), NO_SAMPLE, np.int16)
        if (topic, 0) in topics:
            published_us = topics[topic, 0]["timestamp"]
            run = np.searchsorted(imu_us + ESTIMATOR_LATENCY_US, published_us)
            taken = run < len(imu_us)
            ticks = published_us[taken] // RELATIVE_TICK_US
            relative[run[taken]] = ticks - imu_us[run[taken]] // RELATIVE_TICK_US
        table[column] = relative
    return table


def logged_topics(
    topics: dict[TopicKey, TopicTable], events: FlightEvents, faults: Sequence[Fault], seed: int
) -> tuple[dict[TopicKey, TopicTable], list[Dropout]]:
    """Topics as they get into the log, and the times in which the logger lost messages."""
    profiles = of_kind(faults, DefaultProfile)
    if not profiles:
        intervals = REPLAY_PROFILE_INTERVAL_MS
        topics = {key: _thinned(table, intervals.get(key[0], 0) * 1000) for key, table in topics.items()}
    for profile in profiles:
        topics = _default_profile(topics, events, profile, seed)
    dropouts = []
    for fault in of_kind(faults, LoggerDropout):
        begin_us = round((events.takeoff_s + fault.start_s) * 1e6)
        topics = {key: _without(table, begin_us, fault.duration_s) for key, table in topics.items()}
        dropouts.append(Dropout(begin_us, round(fault.duration_s * 1e3)))
    return topics, dropouts


def _without(table: TopicTable, begin_us: int, duration_s: float) -> TopicTable:
    timestamp = table["timestamp"]
    lost = (timestamp >= begin_us) & (timestamp < begin_us + round(duration_s * 1e6))
    return select_rows(table, ~lost)


def _default_profile(
    topics: dict[TopicKey, TopicTable], events: FlightEvents, profile: DefaultProfile, seed: int
) -> dict[TopicKey, TopicTable]:
    logged = {}
    for (topic, instance), table in topics.items():
        if topic in REPLAY_ONLY_TOPICS:
            continue
        interval_ms = AID_SOURCE_INTERVAL_MS if "aid_src" in topic else DEFAULT_INTERVAL_MS.get(topic, 0)
        logged[topic, instance] = _thinned(table, interval_ms * 1000)
    imu = logged["sensor_combined", 0]
    logged["sensor_combined", 0] = select_rows(imu, ~_lost_samples(len(imu["timestamp"]), profile.imu_loss, seed))
    if profile.from_arming:
        first_us = round(events.armed_s * 1e6)
        logged = {key: _from(table, first_us) for key, table in logged.items()}
    return logged


def _thinned(table: TopicTable, interval_us: int) -> TopicTable:
    """Rows that follow the one logged before by at least the interval."""
    if not interval_us:
        return table
    kept, last_us = [], -interval_us
    for row, timestamp in enumerate(table["timestamp"].tolist()):
        if timestamp - last_us >= interval_us:
            kept.append(row)
            last_us = timestamp
    return select_rows(table, np.array(kept, dtype=np.intp))


def _lost_samples(samples: int, share: float, seed: int) -> np.ndarray:
    """Which of the samples the logger misses, in short runs, (samples,) bool."""
    rng = random_stream(seed, "logger loss")
    run_starts = rng.random(samples) < 2.0 * share / (LONGEST_LOSS + 1.0)
    run_lengths = rng.integers(1, LONGEST_LOSS + 1, samples)
    lost = np.zeros(samples, np.bool_)
    for offset in range(LONGEST_LOSS):
        begins = np.flatnonzero(run_starts & (run_lengths > offset)) + offset
        lost[begins[begins < samples]] = True
    return lost


def _from(table: TopicTable, first_us: int) -> TopicTable:
    """Rows from a time on; of a slow topic also the last one before, which the logger writes when it starts."""
    timestamp = table["timestamp"]
    first = int(np.searchsorted(timestamp, first_us))
    return select_rows(table, np.arange(max(first - 1, 0) if _is_slow(timestamp) else first, len(timestamp)))


def _is_slow(timestamp: np.ndarray) -> bool:
    return len(timestamp) < 2 or (timestamp[-1] - timestamp[0]) / (len(timestamp) - 1) > SLOW_TOPIC_INTERVAL_US
