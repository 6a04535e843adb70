"""Innovation samples by source and axis, looked up one source and axis at a time.

The innovations of one set on an hour of flight are some 60 MB, and every figure is made of one source and axis. So a
table is sorted once, a row group at a time, into a spool, and what is asked for is read from there. A spool is a file
that has no name and goes with its last user, or memory.
"""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from threading import Lock
from typing import IO, Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.px4.aid_sources import AID_SOURCES, MEASURED_SOURCES
from fusetune.storage.files import AnyPath

SourceAxis = tuple[str, int]

_NOT_STORED = ("source", "axis", "measured")
_AXES = 8
"""More than any source has."""
_FEW_ROWS = 300_000
"""Some ten minutes of flight: of those in memory the arrays by axis, half as large again, stay, too."""


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

    def rows(self, selected: np.ndarray) -> AxisSamples:
        """The samples that an index or boolean array selects."""
        parts = {one.name: getattr(self, one.name) for one in fields(self)}
        return AxisSamples(**{name: values[selected] if values.size else values for name, values in parts.items()})

    def part(self, rows: slice) -> AxisSamples:
        """Consecutive samples, which stay where they are."""
        return AxisSamples(*(getattr(self, one.name)[rows] for one in fields(self)))


class SampleSpool:
    """What rows are put into and read from.

    Parameters
    ----------
    folder : of the nameless file that holds them; without it they stay in memory
    """

    def __init__(self, folder: AnyPath | None = None) -> None:
        # several threads may read what one of them has put in
        self._lock = Lock()
        # lives as long as the samples in it
        self._file: IO[bytes] = io.BytesIO() if folder is None else tempfile.TemporaryFile(dir=folder)  # noqa: SIM115

    def put(self, rows: np.ndarray) -> int:
        """Append rows; their place."""
        with self._lock:
            place = self._file.seek(0, 2)
            self._file.write(rows.tobytes())
        return place

    def get(self, places: Iterable[tuple[int, int]], dtype: np.dtype) -> np.ndarray:
        """Rows from several places, each with its number of rows, one after the other."""
        places = list(places)
        rows = np.zeros(sum(count for _, count in places), dtype)
        content, done = rows.view(np.uint8).data, 0
        with self._lock:
            for place, count in places:
                self._file.seek(place)
                done += self._file.readinto(content[done : done + count * dtype.itemsize])  # type: ignore[attr-defined]
        assert done == len(content), "what was put into the spool can be read from it"
        return rows


class SpooledSamples(Mapping[SourceAxis, AxisSamples]):
    """Samples of a set on a flight; each look-up reads from the spool."""

    def __init__(self, spool: SampleSpool, gate: Callable[[str], float]) -> None:
        self._spool, self._gate = spool, gate
        self._names: dict[str, int] = {}
        self._places: dict[SourceAxis, list[tuple[int, int]]] = {}
        self._dtype = np.dtype([])

    def add(self, table: pa.Table) -> None:
        """Put the rows of a table into the spool, but for those that were not measured, or are of unknown sources."""
        if "measured" in table.column_names:
            table = table.filter(table["measured"])
        if not table.num_rows:
            return
        source = table["source"].combine_chunks()
        if not pa.types.is_dictionary(source.type):
            source = source.dictionary_encode()
        names = source.dictionary.to_pylist()
        for name in names:
            self._names.setdefault(name, len(self._names))
        number = np.array([self._names[name] for name in names], np.int64)
        key = number[source.indices.to_numpy()] * _AXES + table["axis"].to_numpy()
        order = np.argsort(key, kind="stable")
        columns = {name: table[name].to_numpy() for name in table.column_names if name not in _NOT_STORED}
        self._dtype = np.dtype([(name, values.dtype) for name, values in columns.items()])
        rows = np.zeros(len(order), self._dtype)
        for name, values in columns.items():
            rows[name] = values[order]
        key, place = key[order], self._spool.put(rows)
        starts = np.flatnonzero(np.r_[True, np.diff(key) != 0])
        by_number = list(self._names)
        for start, stop in zip(starts.tolist(), [*starts[1:].tolist(), key.size], strict=True):
            name, axis = by_number[key[start] // _AXES], int(key[start] % _AXES)
            if name in MEASURED_SOURCES:
                part = (place + start * self._dtype.itemsize, stop - start)
                self._places.setdefault((name, axis), []).append(part)

    def __getitem__(self, key: SourceAxis) -> AxisSamples:
        rows = self._spool.get(self._places[key], self._dtype)
        return _axis_samples(rows, self._gate(key[0]))

    def __iter__(self) -> Iterator[SourceAxis]:
        return iter(sorted(self._places, key=lambda key: (self._names[key[0]], key[1])))

    def __len__(self) -> int:
        return len(self._places)

    def __contains__(self, key: object) -> bool:
        return key in self._places


class SortedSamples(Mapping[SourceAxis, AxisSamples]):
    """Samples of a set on a flight, in memory.

    Parameters
    ----------
    rows : with the fields of `AxisSamples`, `source` and `axis`; of each source and axis in order of time
    names : of the sources by their number
    """

    def __init__(self, rows: np.ndarray, names: Sequence[str], gate: Callable[[str], float]) -> None:
        # of so few values NumPy sorts small integers in the time of some passes
        key = (rows["source"] * _AXES + rows["axis"]).astype(np.uint16)
        counts = np.bincount(key, minlength=len(names) * _AXES)
        stops = np.cumsum(counts)
        rows = rows.take(np.argsort(key, kind="stable"))
        self._rows, self._gate = rows, gate
        self._whole: AxisSamples | None = None
        if len(rows) <= _FEW_ROWS and "test_ratio" in (rows.dtype.names or ()):
            self._rows, self._whole = rows[:0].copy(), _axis_samples(rows, np.nan)
        self._kept: dict[SourceAxis, AxisSamples] = {}
        self._slices = {
            (names[number // _AXES], number % _AXES): slice(int(stops[number] - counts[number]), int(stops[number]))
            for number in np.flatnonzero(counts).tolist()
            if names[number // _AXES] in MEASURED_SOURCES
        }

    def __getitem__(self, key: SourceAxis) -> AxisSamples:
        if self._whole is None:
            return _axis_samples(self._rows[self._slices[key]], self._gate(key[0]))
        found = self._kept.get(key)
        if found is None:
            found = self._kept[key] = self._whole.part(self._slices[key])
        return found

    def __iter__(self) -> Iterator[SourceAxis]:
        return iter(self._slices)

    def __len__(self) -> int:
        return len(self._slices)

    def __contains__(self, key: object) -> bool:
        return key in self._slices


def _axis_samples(rows: np.ndarray, gate: float) -> AxisSamples:
    present = rows.dtype.names or ()

    def column(name: str, dtype: Any = np.float64) -> npt.NDArray[Any]:
        return rows[name].astype(dtype)

    innovation, variance = column("innovation"), column("innovation_variance")
    if "test_ratio" in present:
        test_ratio = column("test_ratio")
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            test_ratio = np.square(innovation) / (gate * gate * variance)
    unknown = np.full(len(rows), np.nan)
    return AxisSamples(
        timestamp_sample=column("timestamp_sample", np.int64),
        observation_variance=column("observation_variance") if "observation_variance" in present else unknown,
        innovation=innovation,
        innovation_variance=variance,
        test_ratio=test_ratio,
        rejected=column("innovation_rejected", np.bool_),
        fused=column("fused", np.bool_),
        observation=column("observation") if "observation" in present else np.zeros(0),
    )


def gate_of(parameters: Mapping[str, float], source: str) -> float:
    """Gate of a source in standard deviations, NaN where it is not known."""
    name = AID_SOURCES[source].gate_parameter
    # PX4 takes no gate below one standard deviation.
    return max(parameters[name], 1.0) if name is not None and name in parameters else np.nan
