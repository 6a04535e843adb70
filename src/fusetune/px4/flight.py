"""One recorded flight in memory: the topics of a ULog and what else the log tells."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from fusetune.px4.releases import name_of_version

TopicKey = tuple[str, int]
"""PX4 topic name and instance (``multi_id``)."""

TopicTable = dict[str, np.ndarray]
"""Field name as pyulog spells it (``"gyro_rad[0]"``) → 1-D array; ``timestamp`` (int64, µs) is always there."""

ParameterValue = int | float


class ParameterChange(NamedTuple):
    """A parameter set while the log was running."""

    timestamp: int
    """µs since boot of the last data message before the change (ULog stores no time with it)."""
    name: str
    value: ParameterValue


class ReplacedParameter(NamedTuple):
    """A parameter with which no vehicle can have flown, see `fusetune.px4.parameters.logged_parameters`."""

    name: str
    value: ParameterValue
    """As logged."""
    used: ParameterValue
    """What stands in its place."""
    timestamp: int | None
    """Of a change in flight that was left out (µs since boot); None for the value that the log begins with."""


class Dropout(NamedTuple):
    """A time in which the logger lost messages."""

    timestamp: int
    duration_ms: int


class LoggedMessage(NamedTuple):
    """A text that the firmware wrote to the log."""

    timestamp: int
    level: str
    text: str


class LeftOut(NamedTuple):
    """Rows of a topic that were left out because they cannot be true."""

    topic: str
    instance: int
    rows: int
    total: int
    """Rows with those that were left out."""
    reason: str


@dataclass
class ParameterHistory:
    """Parameters over the time of a log.

    Values are `int` for INT32 parameters and `float` (exactly a float32) for FLOAT ones.
    """

    initial: dict[str, ParameterValue] = field(default_factory=dict)
    changed: list[ParameterChange] = field(default_factory=list)
    default_system: dict[str, ParameterValue] = field(default_factory=dict)
    default_current_setup: dict[str, ParameterValue] = field(default_factory=dict)

    def at_end(self) -> dict[str, ParameterValue]:
        """Parameters after the last change."""
        return self.initial | {change.name: change.value for change in self.changed}


@dataclass
class Flight:
    """What one log holds.

    Times are µs since boot of the autopilot.
    """

    name: str
    topics: dict[TopicKey, TopicTable] = field(default_factory=dict)
    parameters: ParameterHistory = field(default_factory=ParameterHistory)
    info: dict[str, object] = field(default_factory=dict)
    multi_info: dict[str, list[str]] = field(default_factory=dict)
    dropouts: list[Dropout] = field(default_factory=list)
    messages: list[LoggedMessage] = field(default_factory=list)
    start_timestamp: int = 0
    last_timestamp: int = 0
    checksum: str = ""
    """SHA-256 of the log file, hexadecimal."""
    size_bytes: int = 0
    corruption: tuple[str, ...] = ()
    """What was wrong with the file and could be passed over, in words; empty for a sound log."""
    undefined_topics: tuple[str, ...] = ()
    """Topics that were logged but whose definition the log lacks."""
    left_out: tuple[LeftOut, ...] = ()
    replaced_parameters: tuple[ReplacedParameter, ...] = ()
    beyond_limits: tuple[str, ...] = ()
    """Topics that were logged but are beyond what a log may ask for (`fusetune.px4.ulog.reading_limits`)."""
    release_signs: tuple[str, ...] = ()
    """Flags of the estimator, as they were logged, that tell releases apart (`fusetune.px4.release_signs`)."""

    def topic(self, name: str, instance: int = 0) -> TopicTable | None:
        """Columns of one topic instance, or `None` where the log has none."""
        return self.topics.get((name, instance))

    def instances(self, name: str) -> list[int]:
        """Instances of a topic that the log holds, ascending."""
        return sorted(instance for topic, instance in self.topics if topic == name)

    def has(self, name: str) -> bool:
        """Whether the log holds any instance of a topic."""
        return any(topic == name for topic, _ in self.topics)

    def with_topics(self, topics: dict[TopicKey, TopicTable]) -> Flight:
        """The same flight with other topics."""
        return replace(self, topics=topics)

    def with_more(self, other: Flight) -> Flight:
        """The same flight with further topics of its log; what it has stays.

        Of fewer topics the canonical form makes some tables that the log holds itself.
        """
        return self.with_topics(other.topics | self.topics)

    @property
    def release(self) -> tuple[int, int, int] | None:
        """Firmware release (major, minor, patch), or `None` where the log does not say."""
        version = self.info.get("ver_sw_release")
        if not isinstance(version, int) or not version >> 8:
            return None
        return version >> 24 & 0xFF, version >> 16 & 0xFF, version >> 8 & 0xFF

    @property
    def release_name(self) -> str:
        """Release as PX4 writes it, with the stage: ``"v1.13.3"``, ``"v1.15.0-beta"``, ``"unknown"``."""
        return "unknown" if self.release is None else name_of_version(int(str(self.info["ver_sw_release"])))

    @property
    def duration_s(self) -> float:
        """Seconds from the start of the log to its last message."""
        return max(self.last_timestamp - self.start_timestamp, 0) * 1e-6


def row_count(table: TopicTable) -> int:
    """Number of messages in a topic table."""
    return len(table["timestamp"])


def field_names(table: TopicTable, name: str) -> list[str]:
    """Columns of the array field `name` in order: ``q`` → ``["q[0]", "q[1]", …]``; empty where it is no array."""
    names: list[str] = []
    while f"{name}[{len(names)}]" in table:
        names.append(f"{name}[{len(names)}]")
    return names


def stacked(table: TopicTable, name: str) -> np.ndarray:
    """Array field as one (rows, length) float64 array.

    Raises
    ------
    KeyError
        The table has no such array field.
    """
    names = field_names(table, name)
    if not names:
        raise KeyError(name)
    return np.column_stack([np.asarray(table[column], dtype=np.float64) for column in names])


def select_rows(table: TopicTable, rows: np.ndarray) -> TopicTable:
    """The rows of a table that an index or boolean array selects."""
    return {column: values[rows] for column, values in table.items()}


def merge_tables(tables: Iterable[TopicTable]) -> TopicTable:
    """Rows of several tables in time order, with the columns that all of them have."""
    parts = list(tables)
    columns = [column for column in parts[0] if all(column in part for part in parts)]
    joined = {column: np.concatenate([part[column] for part in parts]) for column in columns}
    return select_rows(joined, np.argsort(joined["timestamp"], kind="stable"))
