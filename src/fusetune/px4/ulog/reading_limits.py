"""How much a log may ask for: time, and tables.

A file of half a megabyte can subscribe to thousands of topics of thousands of columns each, and every column costs as
much as thousands of rows. PX4's own logs have some hundred tables with some thousand columns. Rows need no limit of
their own: each lies in the file, so tables are never larger than it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fusetune.number_settings import checked_numbers
from fusetune.px4.flight import TopicKey
from fusetune.px4.layouts.release_layouts import ESTIMATOR_TOPICS

RAISE_LIMITS = "Log fewer topics, or raise reading.max_tables and reading.max_columns in the configuration"
_USED_TOPICS = frozenset(
    {
        *ESTIMATOR_TOPICS,
        "ekf2_innovations",
        "sensor_gps",
        "vehicle_attitude",
        "vehicle_attitude_groundtruth",
        "vehicle_imu",
        "vehicle_local_position",
        "vehicle_local_position_groundtruth",
        "vehicle_mocap_odometry",
    }
)
_USED_PREFIX = "estimator_"


@dataclass(frozen=True)
class ReadingLimits:
    """Section `reading` of the configuration."""

    time_limit_s: float = 300.0
    """For reading, judging and writing one log; 0 for no limit."""
    max_tables: int = 1000
    """With more topic instances only those that are used become tables."""
    max_columns: int = 30_000
    """With more columns in all tables together, likewise."""

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> ReadingLimits:
        """Limits from the section `reading` of the configuration; keys left out have their defaults.

        Raises
        ------
        UserError
            A key is no limit, or its value no finite number from 0 on.
        """
        return cls(**checked_numbers("reading", "limit", cls, values))


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
