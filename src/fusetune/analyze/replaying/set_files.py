"""Reads what the replay of one (flight, parameter set) wrote: innovations, status flags, local position, summary.

Replays of another program in the same layout, as of PX4's own estimator, are read, too: they need no digest.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fusetune.analyze.replaying.sample_spool import AxisSamples, SampleSpool, SourceAxis, SpooledSamples
from fusetune.px4.aid_sources import AID_SOURCES
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_pieces, read_schema, read_table

__all__ = [
    "AxisSamples",
    "SetRecord",
    "SourceAxis",
    "read_columns",
    "read_columns_in_pieces",
    "read_innovations",
    "read_set",
]

RESET_COUNTERS = {
    "horizontal_position": "xy_reset_counter",
    "height": "z_reset_counter",
    "horizontal_velocity": "vxy_reset_counter",
    "vertical_velocity": "vz_reset_counter",
    "heading": "heading_reset_counter",
}


@dataclass(frozen=True)
class SetRecord:
    """One parameter set's replay of one flight."""

    name: str
    parameters: dict[str, float]
    overrides: dict[str, float]
    summary: dict[str, Any]
    samples: Mapping[SourceAxis, AxisSamples]
    """Look up one source and axis at a time: each may be read from the disk."""
    flags: Mapping[str, npt.NDArray[Any]]
    local_position: Mapping[str, npt.NDArray[Any]]
    """The same goes for these columns."""

    @property
    def status(self) -> str:
        return str(self.summary.get("status", "ok"))

    @property
    def is_warm_started(self) -> bool:
        """Whether the replay started from the vehicle's own state."""
        return bool(self.summary.get("start", {}).get("mode") == "warm")

    @cached_property
    def first_fused(self) -> dict[SourceAxis, int]:
        """Time, µs, of the first sample that was fused, of each source and axis of which one was."""
        first = {}
        for key in self.samples:
            samples = self.samples[key]
            if samples.fused.any():
                first[key] = int(samples.timestamp_sample[np.argmax(samples.fused)])
        return first

    @property
    def fused_sources(self) -> set[str]:
        """Sources that were fused at least once."""
        return {source for source, _ in self.first_fused}

    @cached_property
    def reset_times(self) -> dict[str, npt.NDArray[np.int64]]:
        """Times at which each reset counter moved, µs; one entry for every step of the counter."""
        time = self.local_position.get("timestamp", np.zeros(0, dtype=np.int64)).astype(np.int64)
        times = {}
        for kind, counter in RESET_COUNTERS.items():
            values = self.local_position.get(counter)
            if values is None or values.size < 2:
                times[kind] = np.zeros(0, dtype=np.int64)
                continue
            # The counter is a byte that wraps in the log.
            counts: npt.NDArray[np.int64] = values.astype(np.int64)
            steps = np.subtract(counts[1:], counts[:-1]) & 0xFF
            times[kind] = np.repeat(time[1:], steps)
        return times


class ColumnsOnDisk(Mapping[str, npt.NDArray[Any]]):
    """Columns of a Parquet table, each read when it is asked for and not kept."""

    def __init__(self, path: AnyPath) -> None:
        self._path, self._names = path, column_names(path)

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        if name not in self._names:
            raise KeyError(name)
        return read_columns(self._path, [name])[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def read_columns(path: AnyPath, columns: list[str] | None = None) -> dict[str, npt.NDArray[Any]]:
    """Read a Parquet table of plain columns as NumPy arrays.

    Raises
    ------
    UserError
        If the file is missing or damaged.
    """
    table = read_table(path, columns, sealed=False)
    return {name: table[name].to_numpy() for name in table.column_names}


def read_columns_in_pieces(path: AnyPath, columns: list[str]) -> Iterator[dict[str, npt.NDArray[Any]]]:
    """The same, one part of the rows after the other."""
    for table in read_pieces(path, columns, sealed=False):
        yield {name: table[name].to_numpy() for name in table.column_names}


def column_names(path: AnyPath) -> list[str]:
    """Names of the columns of a Parquet table; raises what `read_columns` does."""
    return list(read_schema(path, sealed=False).names)


def read_set(folder: AnyPath, name: str, spool: SampleSpool | None = None) -> SetRecord:
    """Read `<folder>/<name>.*`; the states are read only where truth is compared (`true_errors`).

    Parameters
    ----------
    spool : where the samples are kept; by default in a file of their own
    """
    folder = Path(folder)
    summary = read_document(folder / f"{name}.json", sealed=False)
    parameters = {key: float(value) for key, value in summary.get("params", {}).items()}
    return SetRecord(
        name=name,
        parameters=parameters,
        overrides={key: float(value) for key, value in summary.get("overrides", {}).items()},
        summary=summary,
        samples=read_innovations(folder / f"{name}.innovations.parquet", parameters, spool),
        flags=read_columns(folder / f"{name}.status_flags.parquet"),
        local_position=ColumnsOnDisk(folder / f"{name}.local_position.parquet"),
    )


def read_innovations(path: AnyPath, parameters: dict[str, float], spool: SampleSpool | None = None) -> SpooledSamples:
    """Read an innovations table, split by source and axis; sources that measure nothing are left out.

    Innovations of reconstructed samples are left out, too: they are no witnesses.

    Parameters
    ----------
    parameters : of this set; where the table has no test ratio, it follows from the source's gate
    spool : where the samples are kept; by default in a nameless file in the folder of the table
    """
    samples = SpooledSamples(spool or SampleSpool(Path(path).parent), lambda source: _gate(source, parameters))
    for piece in read_pieces(path, sealed=False):
        samples.add(piece)
    return samples


def _gate(source: str, parameters: dict[str, float]) -> float:
    name = AID_SOURCES[source].gate_parameter
    # PX4 takes no gate below one standard deviation.
    return max(parameters[name], 1.0) if name is not None and name in parameters else np.nan
