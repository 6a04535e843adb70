"""The innovations that a vehicle logged, in the layout of `estimator_aid_src_*`, for releases that did not log those.

Up to v1.10 `ekf2_innovations` holds everything; from v1.11 there are `estimator_innovations`, `…_innovation_variances`
and `…_innovation_test_ratios`, which repeat each value until the next sample of its source.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusetune.px4.flight import Flight, TopicKey, TopicTable, row_count, select_rows
from fusetune.px4.parameters.ekf2_parameters import complete

_TOPIC_PREFIX = "estimator_aid_src_"
_SAME_PUBLICATION_US = 2000
"""The three topics of v1.11+ are published one after the other; before v1.12 they share no sample time."""

_CS_GNSS, _CS_FLOW, _CS_MAG_HDG, _CS_MAG_3D = 1 << 2, 1 << 3, 1 << 4, 1 << 5
_CS_BARO_HGT, _CS_RNG_HGT, _CS_GNSS_HGT = 1 << 9, 1 << 10, 1 << 11
_CS_EV_POS, _CS_EV_YAW, _CS_EV_HGT, _CS_BETA, _CS_AIRSPEED = 1 << 12, 1 << 13, 1 << 14, 1 << 15, 1 << 19
_CS_GNSS_YAW, _CS_EV_VEL = 1 << 22, 1 << 24
"""Bits of `estimator_status.control_mode_flags`, the same from v1.8 on."""

_NO_MAG_HEADING_FROM = (1, 15)
"""From this release on no heading of the magnetometer is fused: `heading` then holds its largest field innovation."""


@dataclass(frozen=True)
class _Source:
    """Where the innovations of an aid source stand."""

    fields: tuple[str, ...]
    active: int = 0
    """Bits of the control mode flags of which one is set while the source is fused; 0: no flag tells."""
    gate: str = ""
    old_fields: tuple[str, ...] = ()
    """The same in `ekf2_innovations`."""
    unless: int = 0
    """Bits while which something that is no aid source of its own is written to the same fields."""


def _vector(name: str, length: int) -> tuple[str, ...]:
    return tuple(f"{name}[{axis}]" for axis in range(length))


_VELOCITY, _POSITION, _HEIGHT = _vector("vel_pos_innov", 6)[:3], _vector("vel_pos_innov", 6)[3:5], ("vel_pos_innov[5]",)
_HEADING, _OLD_HEADING = ("heading",), ("heading_innov",)

_SOURCES = {
    "gnss_vel": _Source((*_vector("gps_hvel", 2), "gps_vvel"), _CS_GNSS, "EKF2_GPS_V_GATE", _VELOCITY),
    "gnss_pos": _Source(_vector("gps_hpos", 2), _CS_GNSS, "EKF2_GPS_P_GATE", _POSITION),
    "gnss_hgt": _Source(("gps_vpos",), _CS_GNSS_HGT, "EKF2_GPS_P_GATE", _HEIGHT),
    "baro_hgt": _Source(("baro_vpos",), _CS_BARO_HGT, "EKF2_BARO_GATE", _HEIGHT),
    "rng_hgt": _Source(("rng_vpos",), _CS_RNG_HGT, "EKF2_RNG_GATE", _HEIGHT),
    "ev_vel": _Source((*_vector("ev_hvel", 2), "ev_vvel"), _CS_EV_VEL, "EKF2_EVV_GATE", _VELOCITY),
    "ev_pos": _Source(_vector("ev_hpos", 2), _CS_EV_POS, "EKF2_EVP_GATE", _POSITION),
    "ev_hgt": _Source(("ev_vpos",), _CS_EV_HGT, "EKF2_EVP_GATE", _HEIGHT),
    "mag": _Source(_vector("mag_field", 3), _CS_MAG_HDG | _CS_MAG_3D, "EKF2_MAG_GATE", _vector("mag_innov", 3)),
    "mag_heading": _Source(_HEADING, _CS_MAG_HDG, "EKF2_HDG_GATE", _OLD_HEADING, _CS_MAG_3D),
    "gnss_yaw": _Source(_HEADING, _CS_GNSS_YAW, "EKF2_HDG_GATE", _OLD_HEADING, _CS_MAG_3D),
    "ev_yaw": _Source(_HEADING, _CS_EV_YAW, "EKF2_HDG_GATE", _OLD_HEADING, _CS_MAG_3D),
    "optical_flow": _Source(_vector("flow", 2), _CS_FLOW, "EKF2_OF_GATE", _vector("flow_innov", 2)),
    "airspeed": _Source(("airspeed",), _CS_AIRSPEED, "EKF2_TAS_GATE", ("airspeed_innov",)),
    "sideslip": _Source(("beta",), _CS_BETA, "EKF2_BETA_GATE", ("beta_innov",)),
    "drag": _Source(_vector("drag", 2), old_fields=_vector("drag_innov", 2)),
    "aux_vel": _Source(_vector("aux_hvel", 2), old_fields=_vector("aux_vel_innov", 2)),
    "gravity": _Source(_vector("gravity", 3)),
}
"""Fields that several sources name hold the innovations of whichever of them is in use, and of none of them in between.

`heading` does so in all releases. From v1.14 on it holds the largest of the field innovations while the magnetometer is
fused in three dimensions."""


def aid_source_tables(flight: Flight) -> dict[TopicKey, TopicTable]:
    """`estimator_aid_src_*` made from older innovation topics, for each estimator instance of the log.

    One row per new sample of a source while it had an innovation variance. `observation` and `observation_variance`
    are unknown (NaN). `test_ratio` is ν² / (gate² S) per axis with the log's own gate, and the logged one where no
    parameter gives the gate. `innovation_rejected` is true where the logged ratio (or, where none is logged, the
    computed one) of any axis exceeds 1; `fused` where that is not so and the control flags name the source.
    An instance of which the log holds `estimator_aid_src_*` itself is left as it is.
    """
    tables: dict[TopicKey, TopicTable] = {}
    own = {instance for name, instance in flight.topics if name.startswith(_TOPIC_PREFIX)}
    logged = {*flight.instances("estimator_innovations"), *flight.instances("ekf2_innovations")}
    gates = complete(flight.parameters.initial, {}, flight.release) if logged - own else {}
    for instance in sorted(logged - own):
        series = _modern_series(flight, instance) if flight.topic("estimator_innovations", instance) else None
        series = series or _old_series(flight, instance)
        for name, source in _SOURCES.items():
            table = None if series is None else _aid_source(name, source, series, gates)
            if table is not None:
                tables[_TOPIC_PREFIX + name, instance] = table
    return tables


@dataclass(frozen=True)
class _Series:
    """Innovation columns of one estimator instance on common rows."""

    timestamp: np.ndarray
    timestamp_sample: np.ndarray
    innovations: TopicTable
    variances: TopicTable
    ratios: TopicTable
    control_flags: tuple[np.ndarray, np.ndarray] | None
    """Control mode flags as last logged up to each row, and as first logged from it on."""
    old: bool
    has_mag_heading: bool

    def columns(self, source: _Source) -> tuple[str, ...]:
        return source.old_fields if self.old else source.fields


def _modern_series(flight: Flight, instance: int) -> _Series | None:
    innovations = flight.topic("estimator_innovations", instance)
    variances = flight.topic("estimator_innovation_variances", instance)
    if innovations is None or variances is None:
        return None
    ratios = flight.topic("estimator_innovation_test_ratios", instance)
    rows, found = _matching_rows(innovations, variances)
    innovations, variances = select_rows(innovations, found), select_rows(variances, rows[found])
    ratio_columns: TopicTable = {}
    if ratios is not None:
        rows, found = _matching_rows(innovations, ratios)
        ratio_columns = {
            name: np.where(found, values[rows], np.nan)
            for name, values in ratios.items()
            if not name.startswith("timestamp")
        }
    time = innovations["timestamp"]
    sampled = innovations.get("timestamp_sample", time)
    flags = _control_flags(flight, instance, time)
    has_mag_heading = flight.release is None or flight.release[:2] < _NO_MAG_HEADING_FROM
    return _Series(time, sampled, innovations, variances, ratio_columns, flags, False, has_mag_heading)


def _old_series(flight: Flight, instance: int) -> _Series | None:
    table = flight.topic("ekf2_innovations", instance)
    if table is None:
        return None
    variances = {name.replace("_innov_var", "_innov"): table[name] for name in table if "_innov_var" in name}
    time = table["timestamp"]
    return _Series(time, time, table, variances, {}, _control_flags(flight, instance, time), True, True)


def _matching_rows(left: TopicTable, right: TopicTable) -> tuple[np.ndarray, np.ndarray]:
    """For each row of `left` the row of `right` nearest in time, and whether it is of the same publication."""
    name = "timestamp_sample" if "timestamp_sample" in left and "timestamp_sample" in right else "timestamp"
    times, others = left[name], right[name]
    if not len(others):
        return np.zeros(len(times), np.int64), np.zeros(len(times), np.bool_)
    after = np.clip(np.searchsorted(others, times), 0, len(others) - 1)
    before = np.maximum(after - 1, 0)
    rows = np.where(np.abs(others[before] - times) < np.abs(others[after] - times), before, after)
    return rows, np.abs(others[rows] - times) <= _SAME_PUBLICATION_US


def _control_flags(flight: Flight, instance: int, times: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    status = flight.topic("estimator_status", instance)
    if status is None or "control_mode_flags" not in status or not row_count(status):
        return None
    before = np.searchsorted(status["timestamp"], times, side="right") - 1
    after = np.searchsorted(status["timestamp"], times, side="left")
    flags = status["control_mode_flags"].astype(np.int64)
    return flags[np.maximum(before, 0)], flags[np.minimum(after, len(flags) - 1)]


def _aid_source(name: str, source: _Source, series: _Series, gates: dict[str, float]) -> TopicTable | None:
    columns = series.columns(source)
    if not columns or any(column not in series.innovations or column not in series.variances for column in columns):
        return None
    innovation = np.column_stack([series.innovations[column] for column in columns]).astype(np.float64)
    variance = np.column_stack([series.variances[column] for column in columns]).astype(np.float64)
    rows = _new_sample_rows(innovation, variance, _belongs(name, source, series))
    if not len(rows):
        return None
    innovation, variance = innovation[rows], variance[rows]
    logged = [series.ratios.get(column, np.full(len(series.timestamp), np.nan))[rows] for column in columns]
    logged_ratio = np.column_stack(logged).astype(np.float64)
    ratio = innovation**2 / (gates[source.gate] ** 2 * variance) if source.gate else logged_ratio
    rejected = np.any(np.where(np.isfinite(logged_ratio), logged_ratio, ratio) > 1.0, axis=1)
    table: TopicTable = {
        "timestamp": series.timestamp[rows],
        "timestamp_sample": series.timestamp_sample[rows],
        "innovation_rejected": rejected,
        "fused": ~rejected & _active(source, series, rows),
    }
    unknown = np.full_like(innovation, np.nan)
    fields = {"innovation": innovation, "innovation_variance": variance, "test_ratio": ratio}
    for field, values in {"observation": unknown, "observation_variance": unknown, **fields}.items():
        for axis in range(len(columns)):
            column = f"{field}[{axis}]" if len(columns) > 1 else field
            table[column] = values[:, axis].astype(np.float32)
    return table


def _new_sample_rows(innovation: np.ndarray, variance: np.ndarray, belongs: np.ndarray) -> np.ndarray:
    """Rows with an innovation variance whose values are not merely repeated from the usable row before.

    What another source wrote to the same fields is repeated as well, until this one has a sample.
    """
    usable = np.all(np.isfinite(innovation) & np.isfinite(variance) & (variance > 0.0), axis=1)
    rows = np.flatnonzero(usable)
    both = np.hstack([innovation, variance])[rows]
    changed = np.ones(len(rows), np.bool_)
    changed[1:] = np.any(both[1:] != both[:-1], axis=1)
    return rows[changed & belongs[rows]]


def _belongs(name: str, source: _Source, series: _Series) -> np.ndarray:
    """Rows whose values are of this source; where several share the fields, those in which it alone is in use.

    A row between two messages of the status that do not agree on who that is belongs to none, nor does any where the
    log holds no status.
    """
    if name == "mag_heading" and not series.has_mag_heading:
        return np.zeros(len(series.timestamp), np.bool_)
    columns = series.columns(source)
    rivals = [other for other in _SOURCES.values() if other is not source and series.columns(other) == columns]
    if not rivals:
        return np.ones(len(series.timestamp), np.bool_)
    if series.control_flags is None:
        return np.zeros(len(series.timestamp), np.bool_)
    writers = source.active | source.unless
    for other in rivals:
        writers |= other.active
    before, after = series.control_flags
    return ((before & writers) == source.active) & ((after & writers) == source.active)


def _active(source: _Source, series: _Series, rows: np.ndarray) -> np.ndarray:
    if not source.active or series.control_flags is None:
        return np.ones(len(rows), np.bool_)
    return (series.control_flags[0][rows] & source.active) != 0
