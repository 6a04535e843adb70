"""Innovations of every set and of the vehicle's own filter, by aid source and axis, and their test ratios."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.replaying.samples import gate_of
from fusetune.px4.aid_sources import MEASURED_SOURCES
from fusetune.report.flight_data.content import Figures, Panel, Series, Times, with_gaps
from fusetune.report.flight_data.panel_names import RATIOS, innovation_name, ratio_name
from fusetune.report.scored_samples import scored_samples
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_schema, read_table

SourceAxis = tuple[str, int]

_COLUMNS = (
    "source",
    "axis",
    "timestamp_sample",
    "innovation",
    "innovation_variance",
    "test_ratio",
    "innovation_rejected",
    "fused",
)
_MEASURED = "measured"
_AXES = 8
"""More than any source has."""
_SAME_GATE = 1e-3
"""By which gates that follow from single samples may differ, relatively: they are of single precision."""
_MOSTLY = 0.5
"""Share of the samples that have one gate."""
_LEAST_OF_ALL = 1e-3
"""Share of the largest ratio: smaller ones say little of the gate."""


@dataclass(frozen=True)
class AxisInnovations:
    """Innovations of one axis of a source in order of time, (N,) each."""

    time: Times
    innovation: Figures
    variance: Figures
    ratio: Figures
    rejected: npt.NDArray[np.bool_]
    fused: npt.NDArray[np.bool_]

    def since_fused(self) -> AxisInnovations:
        """From the first that was fused on: before, the filter may have no origin. All of them where none ever was."""
        first = int(np.argmax(self.fused)) if self.fused.size else 0
        return self.rows(slice(first, None)) if first else self

    def rows(self, chosen: slice | npt.NDArray[Any]) -> AxisInnovations:
        """Some of them."""
        return AxisInnovations(*(getattr(self, one.name)[chosen] for one in fields(self)))

    @property
    def sigma(self) -> Figures:
        """Standard deviation that the filter claims of the innovation."""
        with np.errstate(invalid="ignore"):
            return np.sqrt(self.variance)

    def gate(self, told: float) -> float | None:
        """The gate by which the estimator tested: ratio = ν² / (gate² S); None where nothing tells it.

        Some samples seem to have another: EKF2 takes part of a barometer's innovation near the ground, and those of
        later axes of the magnetometer anew, after it has tested them.

        Parameters
        ----------
        told : by the parameters; NaN where they do not say
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.abs(self.innovation) / np.sqrt(self.ratio * self.variance)
        # of a ratio that all but vanishes single precision keeps nothing
        clear = self.ratio > _LEAST_OF_ALL * np.nanmax(self.ratio, initial=0.0)
        found = found[clear & np.isfinite(found) & (found > 0.0)].astype(np.float64)
        middle = float(np.median(found)) if found.size else np.nan
        is_shared = found.size > 0 and np.mean(np.abs(found / middle - 1.0) <= _SAME_GATE) >= _MOSTLY
        # a parameter that was changed in flight, or a gate that is a constant
        if is_shared and not abs(told / middle - 1.0) <= _SAME_GATE:
            told = middle
        return float(f"{told:.5g}") if np.isfinite(told) else None


Innovations = Mapping[SourceAxis, AxisInnovations]


def recorded_innovations(path: AnyPath) -> dict[SourceAxis, AxisInnovations]:
    """Of `<set>.innovations.parquet`: all that was measured, of sources that measure something.

    Raises
    ------
    UserError
        The file is missing or damaged.
    """
    known = read_schema(path).names
    table = read_table(path, [name for name in (*_COLUMNS, _MEASURED) if name in known])
    if _MEASURED in known:
        table = table.filter(table[_MEASURED])
    return split_by_axis(table)


def split_by_axis(table: pa.Table) -> dict[SourceAxis, AxisInnovations]:
    """Rows with the columns of `<set>.innovations.parquet` by source and axis, in the order of the table."""
    if not table.num_rows:
        return {}
    source = table["source"].unify_dictionaries().combine_chunks()
    names = source.dictionary.to_pylist()
    key = (source.indices.to_numpy() * _AXES + table["axis"].to_numpy()).astype(np.int16)
    order = np.argsort(key, kind="stable")
    columns = [table[name].to_numpy()[order] for name in _COLUMNS[2:]]
    key = key[order]
    starts = np.flatnonzero(np.r_[True, np.diff(key) != 0]).tolist()
    found = {}
    for start, stop in zip(starts, [*starts[1:], key.size], strict=True):
        name, axis = names[key[start] // _AXES], int(key[start] % _AXES)
        if name in MEASURED_SOURCES:
            found[name, axis] = AxisInnovations(*(one[start:stop] for one in columns)).since_fused()
    return found


def scored_innovations(path: AnyPath, sets: Sequence[str]) -> dict[str, dict[SourceAxis, AxisInnovations]]:
    """Of some sets what `samples.parquet` holds of them: the samples that are scored.

    Raises
    ------
    UserError
        The file is missing or damaged.
    """
    parts: dict[str, dict[SourceAxis, list[tuple[npt.NDArray, ...]]]] = {name: {} for name in sets}
    for one in scored_samples(path, ("time_us", "innovation", "innovation_variance", "test_ratio")):
        if one.set_name in parts:
            parts[one.set_name].setdefault((one.source, one.axis), []).append(one.columns)
    return {name: {key: _joined(rows) for key, rows in by_axis.items()} for name, by_axis in parts.items()}


def _joined(parts: Sequence[tuple[npt.NDArray, ...]]) -> AxisInnovations:
    time, innovation, variance, ratio = (
        np.concatenate(columns) if len(columns) > 1 else columns[0] for columns in zip(*parts, strict=True)
    )
    # what is scored was tested, but a set's own test may have thrown it out
    rejected = ratio > 1.0
    return AxisInnovations(time, innovation, variance, ratio, rejected, ~rejected)


@dataclass(frozen=True)
class SetInnovations:
    """Innovations of one set, and the parameters that it has."""

    name: str
    label: str
    innovations: Innovations
    parameters: Mapping[str, float]


def innovation_panels(sets: Sequence[SetInnovations]) -> Iterator[Panel]:
    """A panel for each source and axis, with every set that has samples of it."""
    for source, one in MEASURED_SOURCES.items():
        for axis in range(one.axes):
            series = tuple(_innovation_series(each, source, axis) for each in sets if _has(each, source, axis))
            if series:
                name = innovation_name(source, axis)
                yield Panel(
                    f"innovation.{source}.{axis}", name.group, name.title, name.unit, series, "innovation", source, axis
                )


def ratio_panels(sets: Sequence[SetInnovations]) -> Iterator[Panel]:
    """A panel for each source with the largest test ratio of its axes, of every set."""
    for source, one in MEASURED_SOURCES.items():
        series = tuple(found for each in sets if (found := _ratio_series(each, source, one.axes)) is not None)
        if series:
            name = ratio_name(source)
            yield Panel(
                f"ratio.{source}", RATIOS, name.title, name.unit, series, "ratio", source, None, log=True, limit=1.0
            )


def _has(one: SetInnovations, source: str, axis: int) -> bool:
    samples = one.innovations.get((source, axis))
    return samples is not None and bool(np.any(np.isfinite(samples.innovation)))


def _innovation_series(one: SetInnovations, source: str, axis: int) -> Series:
    samples = one.innovations[source, axis]
    time, (innovation, sigma, ratio, rejected) = with_gaps(
        samples.time, (samples.innovation, samples.sigma, samples.ratio, samples.rejected)
    )
    gate = samples.gate(gate_of(one.parameters, source))
    return Series(one.label, time, innovation, one.name, sigma, gate, rejected, peaks=ratio)


def _ratio_series(one: SetInnovations, source: str, axes: int) -> Series | None:
    samples = [one.innovations[source, axis] for axis in range(axes) if (source, axis) in one.innovations]
    if not samples:
        return None
    time, ratio = samples[0].time, samples[0].ratio
    for other in samples[1:]:
        if other.time.size == time.size and np.array_equal(other.time, time):
            ratio = np.fmax(ratio, other.ratio)
        else:
            time, ratio = _at_all_times((time, ratio), (other.time, other.ratio))
    if not np.any(np.isfinite(ratio)):
        return None
    time, (ratio,) = with_gaps(time, (ratio,))
    return Series(one.label, time, ratio, one.name)


def _at_all_times(left: tuple[Times, Figures], right: tuple[Times, Figures]) -> tuple[Times, Figures]:
    """The larger of both where both have one, and what one of them has alone."""
    times, places = np.unique(np.concatenate([left[0], right[0]]), return_inverse=True)
    found = np.full(times.size, np.nan)
    np.fmax.at(found, places, np.concatenate([left[1], right[1]]).astype(np.float64))
    return times, found
