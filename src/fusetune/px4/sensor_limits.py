"""What sensor messages can hold at all. ULog has no checksums: a flipped bit shows only as a value that cannot be.

The limits are far outside of what the sensors on autopilots measure (gyroscopes to 4000 °/s, accelerometers to 32 g,
magnetometers to 16 Gs), so a message beyond them is damaged, not unusual.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fusetune.px4.aid_sources import SENSOR_TOPICS, Limit, of_vector, vector
from fusetune.px4.flight import LeftOut, TopicKey, TopicTable, row_count, select_rows
from fusetune.px4.sample_times import is_stamped_by_sample

_FIX_3D = 3
_IMU = "sensor_combined"
NO_ADVANCE = "time does not advance"
_MOST_DISORDER_US = 1_000_000
_MOST_SAMPLE_AGE_US = 10_000_000
_MOST_SAMPLE_LEAD_US = 1_000_000


_INTEGRATION_TIME_US = Limit(1.0, 1e6)
_LIMITS: Mapping[str, Mapping[str, Limit]] = {
    "sensor_combined": {
        **of_vector("gyro_rad", Limit(-100.0, 100.0)),
        **of_vector("accelerometer_m_s2", Limit(-400.0, 400.0)),
        "gyro_integral_dt": _INTEGRATION_TIME_US,
        "accelerometer_integral_dt": _INTEGRATION_TIME_US,
    },
    **{topic.name: topic.limits for topic in SENSOR_TOPICS.values()},
}
_NEEDED: Mapping[str, tuple[str, ...]] = {
    **{topic.name: topic.needed for topic in SENSOR_TOPICS.values()},
    "vehicle_land_detected": ("landed",),
    "vehicle_status": ("arming_state",),
    "vehicle_attitude": vector("q", 4),
    "vehicle_local_position": ("x", "y", "z"),
    "vehicle_imu": (*vector("delta_angle"), *vector("delta_velocity"), "delta_angle_dt", "delta_velocity_dt"),
    "vehicle_command": ("command", *(f"param{number}" for number in range(1, 8))),
    "launch_detection_status": ("launch_detection_state",),
    "estimator_selector_status": ("primary_instance",),
}
"""Fields without which a topic says nothing, or which every release has; those that came later have defaults before."""

LACKS_FIELD = "lacks the field"


def missing_field(topic: str, table: TopicTable) -> str | None:
    """First field that a topic in v1.16's layout cannot do without and lacks; None where it has all."""
    return next((name for name in _NEEDED.get(topic, ()) if name not in table), None)


def impossible_samples(topic: str, table: TopicTable) -> np.ndarray:
    """Rows of a sensor topic in v1.16's layout that hold what cannot be, (rows,) bool."""
    wrong = np.zeros(row_count(table), np.bool_)
    for name, limit in _LIMITS.get(topic, {}).items():
        if name not in table:
            continue
        values = table[name]
        # the comparison is false for NaN, which is so impossible unless it may be
        outside = ~((values >= limit.low) & (values <= limit.high))
        wrong |= outside & ~np.isnan(values) if limit.may_be_nan else outside
    if topic == "vehicle_gps_position" and "fix_type" in table:
        wrong &= table["fix_type"] >= _FIX_3D
    return wrong | _impossible_sample_time(topic, table)


def _impossible_sample_time(topic: str, table: TopicTable) -> np.ndarray:
    """Rows whose sample time cannot be, of topics whose sample time is read at all."""
    sampled = table.get("timestamp_sample")
    if not is_stamped_by_sample(topic) or sampled is None:
        return np.zeros(row_count(table), np.bool_)
    age = table["timestamp"] - sampled
    return (sampled != 0) & ((age > _MOST_SAMPLE_AGE_US) | (age < -_MOST_SAMPLE_LEAD_US))


def without_impossible(topics: Mapping[TopicKey, TopicTable]) -> tuple[dict[TopicKey, TopicTable], tuple[LeftOut, ...]]:
    """Topics in v1.16's layout without samples that cannot be and without topics that lack what they are for.

    The rows of the estimator's topics are in order of time, whatever their order in the file.

    Returns
    -------
    tuple
        The topics that remain, and what was left out of them.
    """
    kept: dict[TopicKey, TopicTable] = {}
    left_out = []
    for key, table in topics.items():
        rows = row_count(table)
        missing = missing_field(key[0], table)
        if missing is not None:
            left_out.append(LeftOut(*key, rows, rows, f"{LACKS_FIELD} {missing}"))
            continue
        if key[0] in _LIMITS or key[0] in _NEEDED:
            for reason, fault in (("impossible value", impossible_samples), (NO_ADVANCE, _stands_still)):
                wrong = fault(key[0], table)
                if wrong.any():
                    left_out.append(LeftOut(*key, int(wrong.sum()), rows, reason))
                    table = select_rows(table, ~wrong)
            table = _in_order(key[0], table)
        if row_count(table) or not rows:
            kept[key] = table
    return kept, tuple(left_out)


def _stands_still(topic: str, table: TopicTable) -> np.ndarray:
    """IMU samples no newer than one before them, unless the clock itself went back, (rows,) bool."""
    timestamps = table["timestamp"]
    if topic != _IMU or len(timestamps) < 2 or np.all(timestamps[1:] > timestamps[:-1]):
        return np.zeros(len(timestamps), np.bool_)
    turns = np.flatnonzero(np.diff(timestamps) < -_MOST_DISORDER_US) + 1
    wrong = np.zeros(len(timestamps), np.bool_)
    for begin, end in zip([0, *turns], [*turns, len(timestamps)], strict=True):
        part = timestamps[begin:end]
        wrong[begin + 1 : end] = part[1:] <= np.maximum.accumulate(part)[:-1]
    return wrong


def _in_order(topic: str, table: TopicTable) -> TopicTable:
    """Rows by time; those of the IMU stay as they are, since a clock that goes back is for the verdict to see."""
    timestamps = table["timestamp"]
    if topic == _IMU or np.all(timestamps[1:] >= timestamps[:-1]):
        return table
    return select_rows(table, np.argsort(timestamps, kind="stable"))
