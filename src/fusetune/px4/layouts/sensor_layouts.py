"""Sensor and vehicle topics of every release in the v1.16 layout: what each had otherwise, and until when.

Every function takes the columns of one topic instance and returns them with what v1.16 has beside; columns of the
log stay. Units are PX4's own of v1.16: degrees and metres for GNSS, µs for integration times.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from fusetune.px4.flight import TopicTable, field_names, row_count

STANDARD_AIR_DENSITY_KG_M3 = 1.225
RELATIVE_TIMESTAMP_INVALID = 0x7FFFFFFF
DOWNWARD_FACING = 25
_ROTARY_WING, _FIXED_WING = 1, 2
_AXES, _QUATERNION_PARTS = 3, 4
_FLOW_DISTANCE_M = (0.0, 10.0)
"""Limits of a flow sensor that EKF2 begins with, before one tells its own."""

_POSE_FRAME_OF_LOCAL_FRAME = {0: 1, 1: 2, 3: 3}
"""LOCAL_FRAME_* (NED, FRD, BODY_FRD) of the odometry message as POSE_FRAME_* / VELOCITY_FRAME_* of v1.14."""

_COVARIANCE_DIAGONAL = (0, 6, 11, 15, 18, 20)
"""Diagonal of a 6×6 matrix in the row-major upper triangle of 21 entries."""


def sensor_combined(table: TopicTable) -> TopicTable:
    """Integration times as whole µs (releases before v1.7 logged seconds); clipping and calibration counts."""
    result = _with_defaults(
        table,
        accelerometer_clipping=np.uint8(0),
        gyro_clipping=np.uint8(0),
        accel_calibration_count=np.uint8(0),
        gyro_calibration_count=np.uint8(0),
    )
    for name in ("gyro_integral_dt", "accelerometer_integral_dt"):
        if name in result and result[name].dtype.kind == "f":
            result[name] = np.round(result[name].astype(np.float64) * 1e6).astype(np.uint32)
    return result


def vehicle_magnetometer(table: TopicTable) -> TopicTable:
    """Sample time (releases before v1.12: the time of publication), device id and calibration count."""
    return _with_defaults(
        table, timestamp_sample=table["timestamp"], device_id=np.uint32(0), calibration_count=np.uint8(0)
    )


def vehicle_air_data(table: TopicTable) -> TopicTable:
    """Sample time, device id, air density, calibration count."""
    return _with_defaults(
        table,
        timestamp_sample=table["timestamp"],
        baro_device_id=np.uint32(0),
        rho=np.float32(STANDARD_AIR_DENSITY_KG_M3),
        calibration_count=np.uint8(0),
    )


def vehicle_gps_position(table: TopicTable) -> TopicTable:
    """Position in degrees and metres (before v1.15: 1e-7 degrees and millimetres), and fields added over time."""
    result = dict(table)
    scaled = {
        "latitude_deg": ("lat", 1e-7),
        "longitude_deg": ("lon", 1e-7),
        "altitude_msl_m": ("alt", 1e-3),
        "altitude_ellipsoid_m": ("alt_ellipsoid", 1e-3),
    }
    for name, (old, unit) in scaled.items():
        if name not in result and old in result:
            result[name] = result[old].astype(np.float64) * unit
    if "heading" in result and "heading_offset" not in result:
        # both came with v1.9; a heading of the antennas alone is none of the vehicle
        result["heading"] = np.full_like(result["heading"], np.nan)
    return _with_defaults(
        result,
        timestamp_sample=table["timestamp"],
        vel_ned_valid=np.True_,
        heading=np.float32(np.nan),
        heading_offset=np.float32(np.nan),
        heading_accuracy=np.float32(0.0),
        hdop=np.float32(0.0),
        vdop=np.float32(0.0),
        jamming_state=np.uint8(0),
        spoofing_state=np.uint8(0),
        device_id=np.uint32(0),
    )


def vehicle_status(table: TopicTable) -> TopicTable:
    """Vehicle type as a number (v1.8 and before: a flag for rotary wing)."""
    rotary = table.get("is_rotary_wing")
    kind = np.uint8(_ROTARY_WING) if rotary is None else np.where(rotary, _ROTARY_WING, _FIXED_WING).astype(np.uint8)
    return _with_defaults(
        table, vehicle_type=kind, is_vtol=np.False_, is_vtol_tailsitter=np.False_, in_transition_mode=np.False_
    )


def vehicle_land_detected(table: TopicTable) -> TopicTable:
    """At rest (before v1.13 unknown: taken as landed) and in ground effect."""
    if "landed" not in table:
        return dict(table)
    return _with_defaults(table, at_rest=table["landed"], in_ground_effect=np.False_)


def distance_sensor(table: TopicTable) -> TopicTable:
    """Signal quality (-1: unknown), orientation, limits."""
    return _with_defaults(
        table,
        signal_quality=np.int8(-1),
        orientation=np.uint8(DOWNWARD_FACING),
        min_distance=np.float32(0.0),
        max_distance=np.float32(np.inf),
    )


def airspeed(table: TopicTable) -> TopicTable:
    """Sample time."""
    return _with_defaults(table, timestamp_sample=table["timestamp"])


def airspeed_validated(table: TopicTable) -> TopicTable:
    """Calibrated airspeed (v1.11: "equivalent"), and which sensor it comes from under both of its names."""
    result = dict(table)
    aliases = {
        "calibrated_airspeed_m_s": ("equivalent_airspeed_m_s", "indicated_airspeed_m_s"),
        "airspeed_source": ("selected_airspeed_index",),
        "selected_airspeed_index": ("airspeed_source",),
    }
    for name, others in aliases.items():
        known = next((other for other in others if other in result), None)
        if name not in result and known is not None:
            result[name] = result[known]
    return result


def vehicle_optical_flow(table: TopicTable) -> TopicTable:
    """Fields of v1.14 from `optical_flow` (v1.13 and before); sign convention and units are the same."""
    renamed = {
        "pixel_flow[0]": "pixel_flow_x_integral",
        "pixel_flow[1]": "pixel_flow_y_integral",
        "delta_angle[0]": "gyro_x_rate_integral",
        "delta_angle[1]": "gyro_y_rate_integral",
        "delta_angle[2]": "gyro_z_rate_integral",
        "integration_timespan_us": "integration_timespan",
        "distance_m": "ground_distance_m",
    }
    result = dict(table)
    result.update({new: table[old] for new, old in renamed.items() if new not in table and old in table})
    # a sensor without a gyro says so by no numbers, and EKF2 takes the IMU's
    result = _without_vectors(result, {"delta_angle": _AXES})
    return _with_defaults(
        result,
        timestamp_sample=table["timestamp"],
        max_flow_rate=np.float32(np.nan),
        min_ground_distance=np.float32(_FLOW_DISTANCE_M[0]),
        max_ground_distance=np.float32(_FLOW_DISTANCE_M[1]),
        distance_m=np.float32(np.nan),
    )


def vehicle_visual_odometry(table: TopicTable) -> TopicTable:
    """Vectors, frames and variances of v1.14 from the odometry message of v1.9 to v1.13."""
    result = dict(table)
    for vector, components in {"position": ("x", "y", "z"), "velocity": ("vx", "vy", "vz")}.items():
        if not _has_any(result, vector):
            known = {f"{vector}[{axis}]": name for axis, name in enumerate(components) if name in table}
            result.update({new: table[old] for new, old in known.items()})
    if "pose_frame" not in result and "local_frame" in table:
        # before v1.11 the velocity has no frame of its own
        velocity_frame = table.get("velocity_frame", table["local_frame"])
        result["pose_frame"] = _new_frames(table["local_frame"])
        result["velocity_frame"] = _new_frames(velocity_frame)
    _add_variances(result, table, "pose_covariance", ("position", "orientation"))
    _add_variances(result, table, "velocity_covariance", ("velocity",))
    # a system may measure some of these only; one that measures none has lost them
    measured = {"position": _AXES, "velocity": _AXES, "q": _QUATERNION_PARTS}
    absent = measured if any(_has_any(result, vector) for vector in measured) else {}
    absent = absent | {f"{kind}_variance": _AXES for kind in ("position", "orientation", "velocity")}
    result = _without_vectors(result, absent)
    if not field_names(table, "position") and "x" not in table:
        result = _with_defaults(result, pose_frame=np.uint8(0))
    if not field_names(table, "velocity") and "vx" not in table:
        result = _with_defaults(result, velocity_frame=np.uint8(0))
    return _with_defaults(result, timestamp_sample=table["timestamp"], reset_counter=np.uint8(0), quality=np.int8(0))


def _without_vectors(table: TopicTable, sizes: Mapping[str, int]) -> TopicTable:
    """The table with vectors that it lacks altogether as no numbers; of others a missing component stays missing."""
    lacking = [f"{name}[{axis}]" for name, size in sizes.items() if not _has_any(table, name) for axis in range(size)]
    return _with_defaults(table, **dict.fromkeys(lacking, np.float32(np.nan)))


def _has_any(table: TopicTable, vector: str) -> bool:
    return any(name.startswith(f"{vector}[") for name in table)


def magnetometer_of_sensor_combined(table: TopicTable) -> TopicTable | None:
    """`vehicle_magnetometer` from `sensor_combined` of releases that had the field there, `None` for others."""
    rows = _new_samples(table, "magnetometer_timestamp_relative")
    if rows is None or len(field_names(table, "magnetometer_ga")) != _AXES:
        return None
    result = {"timestamp": table["timestamp"][rows], "timestamp_sample": _sample_time(table, "magnetometer", rows)}
    result.update({f"magnetometer_ga[{axis}]": table[f"magnetometer_ga[{axis}]"][rows] for axis in range(3)})
    return vehicle_magnetometer(result)


def barometer_of_sensor_combined(table: TopicTable) -> TopicTable | None:
    """`vehicle_air_data` from `sensor_combined` of releases that had the altitude there, `None` for others."""
    rows = _new_samples(table, "baro_timestamp_relative")
    if rows is None or "baro_alt_meter" not in table:
        return None
    result = {"timestamp": table["timestamp"][rows], "timestamp_sample": _sample_time(table, "baro", rows)}
    result["baro_alt_meter"] = table["baro_alt_meter"][rows]
    return vehicle_air_data(result)


def visual_odometry_of_vision_topics(position: TopicTable, attitude: TopicTable | None) -> TopicTable:
    """`vehicle_visual_odometry` from v1.8's `vehicle_vision_position` and `vehicle_vision_attitude`.

    Each position takes the newest attitude at its time; before the first there is none (NaN).
    """
    result: TopicTable = {name: position[name] for name in ("timestamp", "x", "y", "z") if name in position}
    rows = row_count(position)
    for axis, accuracy in enumerate(("eph", "eph", "epv")):
        error = position.get(accuracy, np.full(rows, np.nan))
        result[f"position_variance[{axis}]"] = np.square(error.astype(np.float32))
    if attitude is not None and len(field_names(attitude, "q")) == _QUATERNION_PARTS:
        newest = np.searchsorted(attitude["timestamp"], position["timestamp"], side="right") - 1
        for part in range(4):
            values = attitude[f"q[{part}]"][np.maximum(newest, 0)].astype(np.float32)
            result[f"q[{part}]"] = np.where(newest >= 0, values, np.float32(np.nan))
    result["local_frame"] = np.zeros(rows, np.uint8)
    return vehicle_visual_odometry(result)


def _with_defaults(table: TopicTable, **defaults: np.ndarray | np.generic) -> TopicTable:
    """The table with the columns it lacks; a scalar fills the column."""
    result = dict(table)
    for name, value in defaults.items():
        if name not in result:
            result[name] = np.array(value) if np.ndim(value) else np.full(row_count(table), value)
    return result


def _new_frames(local_frame: np.ndarray) -> np.ndarray:
    frames = np.zeros(len(local_frame), np.uint8)
    for old, new in _POSE_FRAME_OF_LOCAL_FRAME.items():
        frames[local_frame == old] = new
    return frames


def _add_variances(result: TopicTable, table: TopicTable, covariance: str, kinds: tuple[str, ...]) -> None:
    names = [f"{covariance}[{entry}]" for entry in _COVARIANCE_DIAGONAL[: 3 * len(kinds)]]
    if any(name not in table for name in names):
        return
    for block, kind in enumerate(kinds):
        for axis in range(3):
            result.setdefault(f"{kind}_variance[{axis}]", table[names[3 * block + axis]])


def _new_samples(table: TopicTable, relative: str) -> np.ndarray | None:
    """Rows in which a sensor inside `sensor_combined` has a sample that the row before did not have."""
    if relative not in table:
        return None
    time = table["timestamp"] + table[relative].astype(np.int64)
    valid = table[relative] != RELATIVE_TIMESTAMP_INVALID
    newest_before = np.concatenate([[-1], np.maximum.accumulate(np.where(valid, time, -1))[:-1]])
    return np.flatnonzero(valid & (time > newest_before))


def _sample_time(table: TopicTable, sensor: str, rows: np.ndarray) -> np.ndarray:
    return table["timestamp"][rows] + table[f"{sensor}_timestamp_relative"][rows].astype(np.int64)


CONVERTERS: Mapping[str, Callable[[TopicTable], TopicTable]] = {
    function.__name__: function
    for function in (
        sensor_combined,
        vehicle_magnetometer,
        vehicle_air_data,
        vehicle_gps_position,
        vehicle_status,
        vehicle_land_detected,
        distance_sensor,
        airspeed,
        airspeed_validated,
        vehicle_optical_flow,
        vehicle_visual_odometry,
    )
}
"""Topic → function that brings one of its instances to the v1.16 layout."""
