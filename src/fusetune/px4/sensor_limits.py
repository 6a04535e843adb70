"""What sensor messages can hold at all. ULog has no checksums: a flipped bit shows only as a value that cannot be.

The limits are far outside of what the sensors on autopilots measure (gyroscopes to 4000 °/s, accelerometers to 32 g,
magnetometers to 16 Gs), so a message beyond them is damaged, not unusual.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from fusetune.px4.flight import LeftOut, TopicKey, TopicTable, row_count, select_rows
from fusetune.px4.sample_times import STAMPED_BY_SAMPLE

_FIX_3D = 3
_IMU = "sensor_combined"
NO_ADVANCE = "time does not advance"
_MOST_DISORDER_US = 1_000_000
_MOST_SAMPLE_AGE_US = 10_000_000
_MOST_SAMPLE_LEAD_US = 1_000_000


class _Limit(NamedTuple):
    low: float
    high: float
    may_be_nan: bool = False


def _names(name: str, size: int = 3) -> tuple[str, ...]:
    return tuple(f"{name}[{axis}]" for axis in range(size))


def _vector(name: str, limit: _Limit, size: int = 3) -> dict[str, _Limit]:
    return dict.fromkeys(_names(name, size), limit)


_INTEGRATION_TIME_US = _Limit(1.0, 1e6)
_AIRSPEED = {"true_airspeed_m_s": _Limit(-1e3, 1e3, may_be_nan=True)}
_LIMITS: Mapping[str, Mapping[str, _Limit]] = {
    "sensor_combined": {
        **_vector("gyro_rad", _Limit(-100.0, 100.0)),
        **_vector("accelerometer_m_s2", _Limit(-400.0, 400.0)),
        "gyro_integral_dt": _INTEGRATION_TIME_US,
        "accelerometer_integral_dt": _INTEGRATION_TIME_US,
    },
    "vehicle_magnetometer": _vector("magnetometer_ga", _Limit(-50.0, 50.0)),
    "vehicle_air_data": {"baro_alt_meter": _Limit(-5e3, 1e5), "rho": _Limit(0.0, 10.0)},
    "vehicle_gps_position": {
        "latitude_deg": _Limit(-90.0, 90.0),
        "longitude_deg": _Limit(-180.0, 180.0),
        "altitude_msl_m": _Limit(-5e3, 1e5),
        "vel_n_m_s": _Limit(-1e3, 1e3),
        "vel_e_m_s": _Limit(-1e3, 1e3),
        "vel_d_m_s": _Limit(-1e3, 1e3),
        "s_variance_m_s": _Limit(0.0, 1e6),
        "eph": _Limit(0.0, 1e7),
        "epv": _Limit(0.0, 1e7),
        "heading": _Limit(-7.0, 7.0, may_be_nan=True),
    },
    "distance_sensor": {"current_distance": _Limit(-1e4, 1e5, may_be_nan=True)},
    "vehicle_optical_flow": {
        **_vector("pixel_flow", _Limit(-1e3, 1e3, may_be_nan=True), 2),
        **_vector("delta_angle", _Limit(-1e3, 1e3, may_be_nan=True)),
    },
    "vehicle_visual_odometry": {
        **_vector("position", _Limit(-1e7, 1e7, may_be_nan=True)),
        **_vector("velocity", _Limit(-1e3, 1e3, may_be_nan=True)),
        **_vector("q", _Limit(-1.5, 1.5, may_be_nan=True), 4),
    },
    "airspeed": _AIRSPEED | {"indicated_airspeed_m_s": _Limit(-1e3, 1e3, may_be_nan=True)},
    "airspeed_validated": _AIRSPEED | {"calibrated_airspeed_m_s": _Limit(-1e3, 1e3, may_be_nan=True)},
    "landing_target_pose": {
        "vx_rel": _Limit(-1e3, 1e3, may_be_nan=True),
        "vy_rel": _Limit(-1e3, 1e3, may_be_nan=True),
        "cov_vx_rel": _Limit(0.0, 1e9, may_be_nan=True),
        "cov_vy_rel": _Limit(0.0, 1e9, may_be_nan=True),
    },
}
_NEEDED: Mapping[str, tuple[str, ...]] = {
    "vehicle_magnetometer": _names("magnetometer_ga"),
    "vehicle_air_data": ("baro_alt_meter",),
    "vehicle_gps_position": (
        "latitude_deg",
        "longitude_deg",
        "altitude_msl_m",
        "vel_n_m_s",
        "vel_e_m_s",
        "vel_d_m_s",
        "s_variance_m_s",
        "eph",
        "epv",
        "fix_type",
        "satellites_used",
    ),
    "vehicle_land_detected": ("landed",),
    "vehicle_status": ("arming_state",),
    "vehicle_attitude": _names("q", 4),
    "vehicle_local_position": ("x", "y", "z"),
    "vehicle_imu": (*_names("delta_angle"), *_names("delta_velocity"), "delta_angle_dt", "delta_velocity_dt"),
    "vehicle_command": ("command", *(f"param{number}" for number in range(1, 8))),
    "distance_sensor": ("current_distance",),
    "vehicle_optical_flow": (
        *_names("pixel_flow", 2),
        *_names("delta_angle"),
        "integration_timespan_us",
        "quality",
    ),
    "vehicle_visual_odometry": (
        *_names("position"),
        *_names("velocity"),
        *_names("q", 4),
        "pose_frame",
        "velocity_frame",
        *_names("position_variance"),
        *_names("velocity_variance"),
        *_names("orientation_variance"),
    ),
    "airspeed": ("true_airspeed_m_s", "indicated_airspeed_m_s"),
    "airspeed_validated": ("true_airspeed_m_s", "calibrated_airspeed_m_s", "airspeed_source"),
    "landing_target_pose": ("vx_rel", "vy_rel", "cov_vx_rel", "cov_vy_rel", "is_static", "rel_vel_valid"),
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
    if topic not in STAMPED_BY_SAMPLE or sampled is None:
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
