"""Gaps in which a sensor is withheld from the filter: where they lie in a flight, and what was predicted by then.

The innovation of one step ahead shows how well a filter follows its sensor; a filter that follows the sensor's slow
errors looks good by it. After seconds without the sensor, only what the filter knew of velocity, attitude and biases
counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.replaying.replay_settings import WithholdingSettings
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES
from fusetune.ekf2.replay.results import Gap, GapResult
from fusetune.px4.aid_sources import SENSORS, WITHHOLDABLE
from fusetune.px4.flight import Flight

HORIZONS = 3
"""Predictions are compared at a third, two thirds and at the end of a gap."""

AVERAGED_S = 1.0
"""Innovations of so long before a horizon are averaged: they share the drift, but not the measurement's noise."""

_POSITION_FIELDS = ("timestamp", "x", "y", "z", "vx", "vy", "vz")


def plan_gaps(flight: Flight, airborne: Sequence[Interval], settings: WithholdingSettings) -> list[Gap]:
    """Gaps of every sensor that the log has, staggered over the time in flight, in the order of their sensors.

    They depend on the flight alone, so that all parameter sets are compared on the same gaps.
    """
    gaps = []
    for sensor in WITHHOLDABLE:
        length, step = (round(seconds * 1e6) for seconds in (settings.length_s(sensor), settings.every_s(sensor)))
        if length == 0 or flight.topic(SENSORS[sensor].topics[0].name) is None:
            continue
        for start, stop in airborne:
            gaps += [Gap(sensor, first, first + length) for first in range(start, stop - length + 1, step)]
    return gaps


def prediction_table(results: Sequence[GapResult]) -> pa.Table:
    """Mean innovation over the last second before each horizon: one row per gap, source, axis and horizon.

    `innovation_variance` is the mean of the variances that the filter claims; `n` counts the averaged samples.
    """
    columns: dict[str, list[np.ndarray]] = {name: [] for name in _PREDICTION_COLUMNS}
    for number, result in enumerate(results):
        for name, values in _predictions(number, result).items():
            columns[name].append(values)
    sensors = pa.array([result.gap.sensor for result in results], pa.string())
    table = {name: np.concatenate([np.zeros(0, dtype), *columns[name]]) for name, dtype in _PREDICTION_COLUMNS.items()}
    source = pa.DictionaryArray.from_arrays(pa.array(table.pop("source")), pa.array(AID_SOURCE_NAMES))
    return pa.table({"sensor": sensors.take(pa.array(table["gap"])), "source": source} | table)


_PREDICTION_COLUMNS: dict[str, type] = {
    "gap": np.int32,
    "start": np.int64,
    "stop": np.int64,
    "source": np.int32,
    "axis": np.int32,
    "horizon_s": np.float64,
    "n": np.int32,
    "innovation": np.float64,
    "innovation_variance": np.float64,
}


def _predictions(number: int, result: GapResult) -> dict[str, np.ndarray]:
    """Rows of one gap."""
    gap, rows = result.gap, result.innovations
    length_s = (gap.stop - gap.start) * 1e-6
    elapsed_s = (rows["timestamp_sample"] - result.start) * 1e-6
    horizon = np.ceil(elapsed_s / (length_s / HORIZONS)).astype(np.int64)
    before_s = horizon * (length_s / HORIZONS) - elapsed_s
    taken = (horizon >= 1) & (horizon <= HORIZONS) & (before_s < AVERAGED_S)
    key = (rows["source"][taken] * 3 + rows["axis"][taken]) * HORIZONS + horizon[taken] - 1
    found, index = np.unique(key, return_inverse=True)
    count = np.bincount(index, minlength=found.size)

    def mean(name: str) -> np.ndarray:
        return np.bincount(index, rows[name][taken].astype(np.float64), found.size) / np.maximum(count, 1)

    return {
        "gap": np.full(found.size, number, np.int32),
        "start": np.full(found.size, gap.start),
        "stop": np.full(found.size, gap.stop),
        "source": (found // (3 * HORIZONS)).astype(np.int32),
        "axis": (found // HORIZONS % 3).astype(np.int32),
        "horizon_s": (found % HORIZONS + 1) * (length_s / HORIZONS),
        "n": count.astype(np.int32),
        "innovation": mean("innovation"),
        "innovation_variance": mean("innovation_variance"),
    }


def gap_table(results: Sequence[GapResult]) -> pa.Table:
    """Published position and velocity (NED, m and m/s) at the beginning and the end of every gap."""
    columns: dict[str, Any] = {
        "sensor": pa.array([result.gap.sensor for result in results], pa.string()),
        "start": np.array([result.gap.start for result in results], np.int64),
        "stop": np.array([result.gap.stop for result in results], np.int64),
    }
    for row, moment in enumerate(("begin", "end")):
        for name in _POSITION_FIELDS:
            values = [result.local_position[name][row] for result in results]
            columns[f"{name}_{moment}"] = np.array(values, np.int64 if name == "timestamp" else np.float64)
    return pa.table(columns)
