"""The estimator aboard the simulated vehicle: EKF2 itself, run on the flight's own sensors with the flown set.

What it publishes has the names and fields of PX4 v1.16. Fields that the replay does not record (filtered innovations,
state changes at resets) are left out rather than made up.
"""

from __future__ import annotations

import numpy as np

from fusetune.ekf2.feed.inputs import build_inputs
from fusetune.ekf2.filter.common import state as S
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_AXES, AID_SOURCE_NAMES
from fusetune.ekf2.replay.recording import FLAG_COLUMNS
from fusetune.ekf2.replay.replay import replay
from fusetune.ekf2.replay.results import ReplayResult
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.px4.flight import Flight, TopicKey, TopicTable
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.parameters.complete_sets import complete

_MESSAGE_FIELDS = (
    "gps_hvel[0]", "gps_hvel[1]", "gps_vvel", "gps_hpos[0]", "gps_hpos[1]", "gps_vpos",
    "ev_hvel[0]", "ev_hvel[1]", "ev_vvel", "ev_hpos[0]", "ev_hpos[1]", "ev_vpos", "rng_vpos", "baro_vpos",
    "aux_hvel[0]", "aux_hvel[1]", "flow[0]", "flow[1]", "heading", "mag_field[0]", "mag_field[1]", "mag_field[2]",
    "gravity[0]", "gravity[1]", "gravity[2]", "drag[0]", "drag[1]", "airspeed", "beta", "hagl", "hagl_rate",
)  # fmt: skip
"""Fields of `estimator_innovations` in the order of the message."""

_HEADING = "heading"
"""Shared by sources of heading that the simulated vehicle does not have."""

_FIELD_SOURCES = {
    column: (source.name, axis)
    for source in AID_SOURCES.values()
    for axis, column in enumerate(source.innovations)
    if column != _HEADING
} | {"hagl": ("rng_hgt", 0)}

INNOVATION_FIELDS: dict[str, tuple[str, int] | None] = {name: _FIELD_SOURCES.get(name) for name in _MESSAGE_FIELDS}
"""Field of `estimator_innovations` → aid source and axis; `None` where the simulated vehicle has no such source."""

INNOVATION_TOPICS = {
    "estimator_innovations": "innovation",
    "estimator_innovation_variances": "innovation_variance",
    "estimator_innovation_test_ratios": "test_ratio",
}
WIDE_AXES = 2
"""Sources of two axes publish their observation in double precision: it may be a latitude and a longitude."""


def estimator_topics(flight: Flight) -> dict[TopicKey, TopicTable]:
    """Topics that the vehicle's estimator publishes in a flight that holds its sensors and parameters."""
    parameters = complete(flight.parameters.initial, {}, flight.release)
    result = replay(build_inputs(canonical(flight)), parameters)
    if not len(result.states):
        return {}
    sources = {name: _Source(result, index) for index, name in enumerate(AID_SOURCE_NAMES)}
    active = {name: source for name, source in sources.items() if len(source.rows)}
    topics: dict[TopicKey, TopicTable] = {
        (AID_SOURCES[name].topic, 0): source.table() for name, source in active.items()
    }
    for topic, quantity in INNOVATION_TOPICS.items():
        topics[topic, 0] = _latest_values(result, active, quantity)
    topics["estimator_states", 0] = _states(result)
    topics["estimator_status", 0] = _status(result, active, _device_ids(flight))
    topics["estimator_status_flags", 0] = _status_flags(result)
    topics["estimator_sensor_bias", 0] = _sensor_bias(result, _device_ids(flight), parameters)
    topics["vehicle_attitude", 0] = _attitude(result)
    topics["vehicle_local_position", 0] = _local_position(result, active.get("gnss_pos"))
    return topics


class _Source:
    """Rows of one aid source, one per sample, with the time of the update that published each."""

    def __init__(self, result: ReplayResult, index: int) -> None:
        rows = result.innovations[result.innovations["source"] == index]
        self.axes = AID_SOURCE_AXES[AID_SOURCE_NAMES[index]]
        self.rows = rows.reshape(-1, self.axes)
        horizon = result.states["timestamp_sample"]
        update = np.searchsorted(horizon, self.rows["timestamp_sample"][:, 0])
        self.timestamp = result.states["timestamp"][np.minimum(update, len(horizon) - 1)].astype(np.int64)

    def last_before(self, timestamp: np.ndarray) -> np.ndarray:
        """Row published last at each time; -1 before the first."""
        return np.searchsorted(self.timestamp, timestamp, side="right") - 1

    def time_last_fuse(self) -> np.ndarray:
        """Publication time of the last fused sample up to each row; 0 before the first."""
        return np.maximum.accumulate(np.where(self.rows["fused"][:, 0], self.timestamp, 0)).astype(np.uint64)

    def table(self) -> TopicTable:
        """The source as its topic."""
        first = self.rows[:, 0]
        table: TopicTable = {
            "timestamp": self.timestamp,
            "timestamp_sample": first["timestamp_sample"].astype(np.int64),
            "time_last_fuse": self.time_last_fuse(),
            "estimator_instance": np.zeros(len(first), np.uint8),
            "device_id": np.zeros(len(first), np.uint32),
        }
        for quantity in ("observation", "observation_variance", "innovation", "innovation_variance", "test_ratio"):
            wide = quantity == "observation" and self.axes == WIDE_AXES
            for axis in range(self.axes):
                column = quantity if self.axes == 1 else f"{quantity}[{axis}]"
                table[column] = self.rows[quantity][:, axis].astype(np.float64 if wide else np.float32)
        return table | {
            "innovation_rejected": first["innovation_rejected"].astype(np.bool_),
            "fused": first["fused"].astype(np.bool_),
        }


def _stamped(rows: np.ndarray, sample: str = "timestamp_sample") -> TopicTable:
    return {"timestamp": rows["timestamp"].astype(np.int64), "timestamp_sample": rows[sample].astype(np.int64)}


def _columns(name: str, values: np.ndarray) -> TopicTable:
    return {f"{name}[{index}]": np.ascontiguousarray(values[:, index]) for index in range(values.shape[1])}


def _latest_values(result: ReplayResult, sources: dict[str, _Source], quantity: str) -> TopicTable:
    """The newest value of each source at every update; 0 before its first."""
    table = _stamped(result.states)
    for field, place in INNOVATION_FIELDS.items():
        values = np.zeros(len(result.states), np.float32)
        if place is not None and place[0] in sources:
            source, axis = sources[place[0]], place[1]
            row = source.last_before(table["timestamp"])
            values[row >= 0] = source.rows[quantity][row[row >= 0], axis]
        table[field] = values
    return table


def _states(result: ReplayResult) -> TopicTable:
    return {
        **_stamped(result.states),
        **_columns("states", result.states["states"]),
        **_columns("covariances", result.states["covariances"]),
        "n_states": np.full(len(result.states), S.PUBLISHED_STATE_SIZE, np.uint8),
    }


def _flag_rows(result: ReplayResult) -> np.ndarray:
    """Flags in force at each update, (updates, flags)."""
    row = np.searchsorted(result.flags["timestamp"], result.states["timestamp"], side="right") - 1
    return np.asarray(result.flags["flags"][np.maximum(row, 0)])


def _bits(flags: np.ndarray, prefix: str) -> np.ndarray:
    """Flags of one group as a number, (updates,) uint64."""
    group = [index for index, name in enumerate(FLAG_COLUMNS) if name.startswith(prefix)]
    return np.asarray((flags[:, group].astype(np.uint64) << np.arange(len(group), dtype=np.uint64)).sum(axis=1))


def _status(result: ReplayResult, sources: dict[str, _Source], devices: dict[str, int]) -> TopicTable:
    flags, position = _flag_rows(result), result.local_position
    table: TopicTable = {
        **_stamped(result.states),
        "control_mode_flags": _bits(flags, "cs_"),
        "filter_fault_flags": _bits(flags, "fs_").astype(np.uint32),
        "pos_horiz_accuracy": position["eph"].astype(np.float32),
        "pos_vert_accuracy": position["epv"].astype(np.float32),
        "time_slip": np.zeros(len(flags), np.float32),
    }
    for field, names in {
        "hdg_test_ratio": ("mag",),
        "vel_test_ratio": ("gnss_vel",),
        "pos_test_ratio": ("gnss_pos",),
        "hgt_test_ratio": ("baro_hgt", "gnss_hgt"),
    }.items():
        table[field] = _largest_test_ratio(table["timestamp"], [sources[name] for name in names if name in sources])
    counters = {"vel_ne": "vxy", "vel_d": "vz", "pos_ne": "xy", "pod_d": "z", "quat": "heading"}
    for field, counter in counters.items():
        table[f"reset_count_{field}"] = position[f"{counter}_reset_counter"].astype(np.uint8)
    return table | {f"{sensor}_device_id": np.full(len(flags), number, np.uint32) for sensor, number in devices.items()}


def _device_ids(flight: Flight) -> dict[str, int]:
    """Identities of the sensors that the estimator used; 0 where there is none."""
    fields = {
        "accel": ("sensor_selection", "accel_device_id"),
        "gyro": ("sensor_selection", "gyro_device_id"),
        "baro": ("vehicle_air_data", "baro_device_id"),
        "mag": ("vehicle_magnetometer", "device_id"),
    }
    tables = {sensor: (flight.topic(topic), field) for sensor, (topic, field) in fields.items()}
    return {sensor: int(table[field][0]) if table else 0 for sensor, (table, field) in tables.items()}


def _largest_test_ratio(timestamp: np.ndarray, sources: list[_Source]) -> np.ndarray:
    """Root of the largest test ratio of some sources at each time, as `estimator_status` tells it."""
    largest = np.zeros(len(timestamp), np.float32)
    for source in sources:
        row = source.last_before(timestamp)
        ratio = source.rows["test_ratio"].max(axis=1)
        largest[row >= 0] = np.maximum(largest[row >= 0], ratio[row[row >= 0]])
    return np.sqrt(largest)


def _status_flags(result: ReplayResult) -> TopicTable:
    timestamp = result.flags["timestamp"].astype(np.int64)
    flags = result.flags["flags"].astype(np.bool_)
    update = np.searchsorted(result.states["timestamp"], timestamp)
    horizon = result.states["timestamp_sample"][np.minimum(update, len(result.states) - 1)].astype(np.int64)
    return {
        "timestamp": timestamp,
        "timestamp_sample": horizon,
        "control_status_changes": _changes(flags, "cs_"),
        "fault_status_changes": _changes(flags, "fs_"),
        "innovation_fault_status_changes": _changes(flags, "reject_"),
        **{name: np.ascontiguousarray(flags[:, index]) for index, name in enumerate(FLAG_COLUMNS)},
    }


def _changes(flags: np.ndarray, prefix: str) -> np.ndarray:
    """How often any flag of a group has changed up to each row, (rows,) uint32."""
    group = [index for index, name in enumerate(FLAG_COLUMNS) if name.startswith(prefix)]
    before = np.vstack([np.zeros((1, len(group)), np.bool_), flags[:-1, group]])
    return np.cumsum((flags[:, group] != before).any(axis=1)).astype(np.uint32)


def _sensor_bias(result: ReplayResult, devices: dict[str, int], parameters: dict[str, float]) -> TopicTable:
    rows, updates = result.states, len(result.states)
    places = {
        "gyro": (S.PUBLISHED_GYRO_BIAS, S.GYRO_BIAS, parameters["EKF2_GYR_B_LIM"]),
        "accel": (S.PUBLISHED_ACCEL_BIAS, S.ACCEL_BIAS, parameters["EKF2_ABL_LIM"]),
        "mag": (S.PUBLISHED_MAG_BODY, S.MAG_BODY, 0.5),
    }
    table = _stamped(rows)
    for sensor, (published, error, limit) in places.items():
        table[f"{sensor}_device_id"] = np.full(updates, devices[sensor], np.uint32)
        table |= _columns(f"{sensor}_bias", rows["states"][:, published : published + 3])
        table[f"{sensor}_bias_limit"] = np.full(updates, limit, np.float32)
        table |= _columns(f"{sensor}_bias_variance", rows["covariances"][:, error : error + 3])
        table[f"{sensor}_bias_valid"] = np.ones(updates, np.bool_)
    return table


def _attitude(result: ReplayResult) -> TopicTable:
    position = result.local_position
    return {
        **_stamped(position, "timestamp"),
        **_columns("q", position["q"]),
        "quat_reset_counter": position["heading_reset_counter"].astype(np.uint8),
    }


def _local_position(result: ReplayResult, gnss_position: _Source | None) -> TopicTable:
    rows, updates = result.local_position, len(result.local_position)
    table = _stamped(rows, "timestamp")
    has_origin = np.zeros(updates, np.bool_)
    if result.origin is not None and gnss_position is not None and gnss_position.rows["fused"].any():
        first = gnss_position.timestamp[np.argmax(gnss_position.rows["fused"][:, 0])]
        has_origin = table["timestamp"] >= first
    latitude, longitude, altitude = result.origin or (np.nan, np.nan, np.nan)
    table["ref_timestamp"] = np.where(has_origin, _first_or_zero(table["timestamp"][has_origin]), 0).astype(np.uint64)
    table["ref_lat"] = np.where(has_origin, latitude, np.nan)
    table["ref_lon"] = np.where(has_origin, longitude, np.nan)
    table["ref_alt"] = np.where(has_origin, altitude, np.nan).astype(np.float32)
    for name in ("x", "y", "z", "vx", "vy", "vz", "heading", "eph", "epv"):
        table[name] = rows[name].astype(np.float32)
    for name in ("xy", "z", "vxy", "vz", "heading"):
        table[f"{name}_reset_counter"] = rows[f"{name}_reset_counter"].astype(np.uint8)
    velocity_variance = result.states["covariances"][:, S.VELOCITY : S.VELOCITY + 3]
    table["evh"] = np.sqrt(velocity_variance[:, 0] + velocity_variance[:, 1]).astype(np.float32)
    table["evv"] = np.sqrt(velocity_variance[:, 2]).astype(np.float32)
    dead_reckoning = FLAG_COLUMNS.index("cs_inertial_dead_reckoning")
    return table | {
        "dead_reckoning": _flag_rows(result)[:, dead_reckoning].astype(np.bool_),
        "xy_valid": rows["xy_valid"].astype(np.bool_),
        "z_valid": rows["z_valid"].astype(np.bool_),
        "v_xy_valid": rows["xy_valid"].astype(np.bool_),
        "v_z_valid": rows["z_valid"].astype(np.bool_),
        "xy_global": has_origin,
        "z_global": has_origin.copy(),
    }


def _first_or_zero(values: np.ndarray) -> int:
    return int(values[0]) if len(values) else 0
