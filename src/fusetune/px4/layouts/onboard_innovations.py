"""The innovations that a vehicle logged, in the layout of `estimator_aid_src_*`, for releases that did not log those.

Up to v1.10 `ekf2_innovations` holds everything; from v1.11 there are `estimator_innovations`, `…_innovation_variances`
and `…_innovation_test_ratios`, which repeat each value until the next sample of its source.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusetune.px4.aid_sources import AID_SOURCE_TOPIC, AID_SOURCES, AidSource
from fusetune.px4.flight import Flight, TopicKey, TopicTable, row_count, select_rows
from fusetune.px4.flown_parameters import flown_parameters
from fusetune.px4.layouts.estimator_layouts import control_bits
from fusetune.px4.releases import NO_MAG_HEADING

_SAME_PUBLICATION_US = 2000
"""The three topics of v1.11+ are published one after the other; before v1.12 they share no sample time."""

_MAG_3D = control_bits(("cs_mag_3d",))
_HEADING_FIELDS = (("heading",), ("heading_innov",))
"""Written by the magnetometer's three axes as well, while these are fused; see `_SOURCES`."""

_SOURCES = {source.name: source for source in AID_SOURCES.values() if source.innovations}
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
    own = {instance for name, instance in flight.topics if name.startswith(AID_SOURCE_TOPIC)}
    logged = {*flight.instances("estimator_innovations"), *flight.instances("ekf2_innovations")}
    gates = flown_parameters(flight) if logged - own else {}
    for instance in sorted(logged - own):
        series = _modern_series(flight, instance) if flight.topic("estimator_innovations", instance) else None
        series = series or _old_series(flight, instance)
        for name, source in _SOURCES.items():
            table = None if series is None else _aid_source(name, source, series, gates)
            if table is not None:
                tables[source.topic, instance] = table
    return tables


def tables_of_test_ratios(flight: Flight, instance: int) -> dict[TopicKey, TopicTable]:
    """`estimator_aid_src_*` of one estimator instance from its test ratios alone (v1.11 on); none where it logged none.

    For logs in which the logger took innovations and their variances at different updates, as of several instances it
    mostly does, so that few can be put together. Innovations and variances are unknown (NaN). Ratios are those of the
    filter, not low-pass filtered, with one for all axes of a group in its first; rows as in `aid_source_tables`, while
    the control flags name the source.
    """
    ratios = flight.topic("estimator_innovation_test_ratios", instance)
    if ratios is None or not row_count(ratios):
        return {}
    time = ratios["timestamp"]
    sampled = ratios.get("timestamp_sample", time)
    has_mag_heading = flight.release is None or flight.release[:2] < NO_MAG_HEADING
    flags = _control_flags(flight, instance, time)
    series = _Series(time, sampled, ratios, {}, ratios, flags, False, has_mag_heading)
    tables = ((source.topic, _of_test_ratios(name, source, series)) for name, source in _SOURCES.items())
    return {(topic, instance): table for topic, table in tables if table is not None}


def _of_test_ratios(name: str, source: AidSource, series: _Series) -> TopicTable | None:
    columns = series.columns(source)
    if not columns or any(column not in series.ratios for column in columns):
        return None
    ratio = np.column_stack([series.ratios[column] for column in columns]).astype(np.float64)
    ratio[~np.isfinite(ratio)] = 0.0
    known = np.broadcast_to(np.any(ratio > 0.0, axis=1, keepdims=True), ratio.shape).astype(np.float64)
    every = np.arange(len(ratio))
    rows = _new_sample_rows(ratio, known, _belongs(name, source, series) & _active(source, series, every))
    if not len(rows):
        return None
    rejected = np.any(ratio[rows] > 1.0, axis=1)
    table: TopicTable = {
        "timestamp": series.timestamp[rows],
        "timestamp_sample": series.timestamp_sample[rows],
        "innovation_rejected": rejected,
        "fused": ~rejected,
    }
    unknown = np.full(len(rows), np.nan, np.float32)
    for axis in range(len(columns)):
        column = f"[{axis}]" if len(columns) > 1 else ""
        table |= {f"innovation{column}": unknown, f"innovation_variance{column}": unknown}
        table[f"test_ratio{column}"] = ratio[rows, axis].astype(np.float32)
    return table


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

    def columns(self, source: AidSource) -> tuple[str, ...]:
        return source.ekf2_innovations if self.old else source.innovations


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
    has_mag_heading = flight.release is None or flight.release[:2] < NO_MAG_HEADING
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


def _aid_source(name: str, source: AidSource, series: _Series, gates: dict[str, float]) -> TopicTable | None:
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
    ratio = innovation**2 / (gates[source.gate_parameter] ** 2 * variance) if source.gate_parameter else logged_ratio
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


def _belongs(name: str, source: AidSource, series: _Series) -> np.ndarray:
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
    active = control_bits(source.flags)
    writers = active | (_MAG_3D if columns in _HEADING_FIELDS else 0)
    for other in rivals:
        writers |= control_bits(other.flags)
    before, after = series.control_flags
    return ((before & writers) == active) & ((after & writers) == active)


def _active(source: AidSource, series: _Series, rows: np.ndarray) -> np.ndarray:
    active = control_bits(source.flags)
    if not active or series.control_flags is None:
        return np.ones(len(rows), np.bool_)
    return (series.control_flags[0][rows] & active) != 0
