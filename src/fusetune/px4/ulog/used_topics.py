"""Which topics any room reads, and which of a log's become tables where it asks for more than it may."""

from __future__ import annotations

from collections.abc import Mapping

from fusetune.px4.flight import TopicKey
from fusetune.px4.layouts.release_layouts import ESTIMATOR_TOPICS
from fusetune.px4.ulog.reading_limits import ReadingLimits

_USED_TOPICS = frozenset(
    {
        *ESTIMATOR_TOPICS,
        "actuator_controls_0",
        "actuator_motors",
        "actuator_outputs",
        "ekf2_innovations",
        "mission_result",
        "position_setpoint_triplet",
        "sensor_accel",
        "sensor_accel_fifo",
        "sensor_gps",
        "sensor_gyro",
        "sensor_gyro_fifo",
        "vehicle_attitude",
        "vehicle_attitude_groundtruth",
        "vehicle_imu",
        "vehicle_imu_status",
        "vehicle_local_position",
        "vehicle_local_position_groundtruth",
        "vehicle_mocap_odometry",
        "vehicle_thrust_setpoint",
    }
)
_USED_PREFIX = "estimator_"


def is_used(topic: str) -> bool:
    """Whether any room reads a topic."""
    return topic in _USED_TOPICS or topic.startswith(_USED_PREFIX)


def within_limits(columns: Mapping[TopicKey, int], limits: ReadingLimits) -> set[TopicKey]:
    """Topic instances that become tables: all, or of those that are used as many as the limits allow.

    Parameters
    ----------
    columns
        Number of columns of each topic instance.
    """
    if len(columns) <= limits.max_tables and sum(columns.values()) <= limits.max_columns:
        return set(columns)
    kept: set[TopicKey] = set()
    total = 0
    # the first instances matter most, so that no topic with hundreds of them takes the place of another
    for key in sorted((key for key in columns if is_used(key[0])), key=lambda key: (key[1], key[0])):
        if len(kept) < limits.max_tables and total + columns[key] <= limits.max_columns:
            kept.add(key)
            total += columns[key]
    return kept
