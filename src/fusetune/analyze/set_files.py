"""Reads what the replay of one (flight, parameter set) wrote: innovations, status flags, local position, summary.

Replays of another program in the same layout, as of PX4's own estimator, are read, too: they need no digest.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.sources import AID_SOURCES
from fusetune.documents import read_document
from fusetune.files import AnyPath
from fusetune.parquet import read_table

SourceAxis = tuple[str, int]

RESET_COUNTERS = {
    "horizontal_position": "xy_reset_counter",
    "height": "z_reset_counter",
    "horizontal_velocity": "vxy_reset_counter",
    "vertical_velocity": "vz_reset_counter",
    "heading": "heading_reset_counter",
}


@dataclass(frozen=True)
class AxisSamples:
    """All samples of one axis of one aid source in order of time, arrays of shape (N,).

    `timestamp_sample` is the delayed time at which the estimator used the measurement, µs. `observation` is the
    measurement as the estimator used it, empty where only innovations are known.
    """

    timestamp_sample: npt.NDArray[np.int64]
    observation_variance: npt.NDArray[np.float64]
    innovation: npt.NDArray[np.float64]
    innovation_variance: npt.NDArray[np.float64]
    test_ratio: npt.NDArray[np.float64]
    rejected: npt.NDArray[np.bool_]
    fused: npt.NDArray[np.bool_]
    observation: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class SetRecord:
    """One parameter set's replay of one flight."""

    name: str
    parameters: dict[str, float]
    overrides: dict[str, float]
    summary: dict[str, Any]
    samples: dict[SourceAxis, AxisSamples]
    flags: dict[str, npt.NDArray[Any]]
    local_position: dict[str, npt.NDArray[Any]]

    @property
    def status(self) -> str:
        return str(self.summary.get("status", "ok"))

    @property
    def is_warm_started(self) -> bool:
        """Whether the replay started from the vehicle's own state."""
        return bool(self.summary.get("start", {}).get("mode") == "warm")


def read_columns(path: AnyPath, columns: list[str] | None = None) -> dict[str, npt.NDArray[Any]]:
    """Read a Parquet table of plain columns as NumPy arrays.

    Raises
    ------
    UserError
        If the file is missing or damaged.
    """
    table = read_table(path, columns, sealed=False)
    return {name: table[name].to_numpy() for name in table.column_names}


def read_set(folder: AnyPath, name: str) -> SetRecord:
    """Read `<folder>/<name>.*`; the states are read only where truth is compared (`true_errors`)."""
    folder = Path(folder)
    summary = read_document(folder / f"{name}.json", sealed=False)
    parameters = {key: float(value) for key, value in summary.get("params", {}).items()}
    return SetRecord(
        name=name,
        parameters=parameters,
        overrides={key: float(value) for key, value in summary.get("overrides", {}).items()},
        summary=summary,
        samples=read_innovations(folder / f"{name}.innovations.parquet", parameters),
        flags=read_columns(folder / f"{name}.status_flags.parquet"),
        local_position=read_columns(folder / f"{name}.local_position.parquet"),
    )


def read_innovations(path: AnyPath, parameters: dict[str, float]) -> dict[SourceAxis, AxisSamples]:
    """Read an innovations table, split by source and axis; sources that measure nothing are left out.

    Innovations of reconstructed samples are left out, too: they are no witnesses.

    Parameters
    ----------
    parameters : of this set; where the table has no test ratio, it follows from the source's gate
    """
    table = read_table(path, sealed=False)
    if "measured" in table.column_names:
        table = table.filter(table["measured"]).drop_columns("measured")
    if table.num_rows == 0:
        return {}
    source = table["source"].combine_chunks()
    if not pa.types.is_dictionary(source.type):
        source = source.dictionary_encode()
    names = source.dictionary.to_pylist()
    key = source.indices.to_numpy().astype(np.int64) * 8 + table["axis"].to_numpy()
    order = np.argsort(key, kind="stable")
    key = key[order]
    columns = {name: table[name].to_numpy()[order] for name in table.column_names if name not in ("source", "axis")}
    starts = np.flatnonzero(np.r_[True, np.diff(key) != 0])
    stops = np.r_[starts[1:], key.size]
    samples: dict[SourceAxis, AxisSamples] = {}
    for start, stop in zip(starts, stops, strict=True):
        name, axis = names[key[start] >> 3], int(key[start] & 7)
        if name in AID_SOURCES:
            rows = slice(start, stop)
            samples[name, axis] = _axis_samples(columns, rows, _gate(name, parameters))
    return samples


def _gate(source: str, parameters: dict[str, float]) -> float:
    name = AID_SOURCES[source].gate_parameter
    # PX4 takes no gate below one standard deviation.
    return max(parameters[name], 1.0) if name is not None and name in parameters else np.nan


def _axis_samples(columns: dict[str, npt.NDArray[Any]], rows: slice, gate: float) -> AxisSamples:
    innovation = columns["innovation"][rows].astype(np.float64)
    variance = columns["innovation_variance"][rows].astype(np.float64)
    if "test_ratio" in columns:
        test_ratio = columns["test_ratio"][rows].astype(np.float64)
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            test_ratio = np.square(innovation) / (gate * gate * variance)
    return AxisSamples(
        timestamp_sample=columns["timestamp_sample"][rows].astype(np.int64),
        observation_variance=columns["observation_variance"][rows].astype(np.float64),
        innovation=innovation,
        innovation_variance=variance,
        test_ratio=test_ratio,
        rejected=columns["innovation_rejected"][rows].astype(bool),
        fused=columns["fused"][rows].astype(bool),
        observation=columns["observation"][rows].astype(np.float64) if "observation" in columns else np.zeros(0),
    )


def reset_times(record: SetRecord) -> dict[str, npt.NDArray[np.int64]]:
    """Times at which each reset counter moved, µs; one entry for every step of the counter."""
    time = record.local_position.get("timestamp", np.zeros(0, dtype=np.int64)).astype(np.int64)
    times = {}
    for kind, counter in RESET_COUNTERS.items():
        values = record.local_position.get(counter)
        if values is None or values.size < 2:
            times[kind] = np.zeros(0, dtype=np.int64)
            continue
        # The counter is a byte that wraps in the log.
        counts: npt.NDArray[np.int64] = values.astype(np.int64)
        steps = np.subtract(counts[1:], counts[:-1]) & 0xFF
        times[kind] = np.repeat(time[1:], steps)
    return times
