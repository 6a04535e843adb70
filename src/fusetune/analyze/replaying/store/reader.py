"""Reads the files of one replay.

Replays of another program in the same layout, as of PX4's own estimator, are read, too: they need no digest, and may
have neither gaps nor the IMU beside the states.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.replaying.replayed_set import (
    STATE_BLOCKS,
    STEP_BLOCKS,
    Block,
    Columns,
    FilterStates,
    ReplayedSet,
    ReplayedSteps,
    joined_states,
    joined_steps,
    values_of,
)
from fusetune.analyze.replaying.samples import SampleSpool, SpooledSamples, gate_of
from fusetune.analyze.replaying.store.parts import summary_file, table_file
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_pieces, read_schema, read_table


class ColumnsOnDisk(Mapping[str, npt.NDArray[Any]]):
    """Columns of a Parquet table, each read when it is asked for and not kept."""

    def __init__(self, path: AnyPath) -> None:
        self._path, self._names = path, list(read_schema(path, sealed=False).names)

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
    return columns_of(read_table(path, columns, sealed=False))


def columns_of(table: pa.Table) -> dict[str, npt.NDArray[Any]]:
    """A table as NumPy arrays."""
    return {name: table[name].to_numpy() for name in table.column_names}


def read_set(folder: AnyPath, name: str, spool: SampleSpool | None = None) -> ReplayedSet:
    """The replay of a set, from `<folder>/<name>.*`; what is large is read when it is asked for.

    Parameters
    ----------
    spool : where the samples are kept; by default in a file of their own

    Raises
    ------
    UserError
        If a file is missing or damaged.
    """
    summary = read_document(summary_file(folder, name), sealed=False)
    parameters = values_of(summary, "params")
    withheld, gaps = (table_file(folder, name, table) for table in ("withheld", "gaps"))
    return ReplayedSet(
        name=name,
        parameters=parameters,
        overrides=values_of(summary, "overrides"),
        summary=summary,
        samples=read_innovations(table_file(folder, name, "innovations"), parameters, spool),
        flags=read_columns(table_file(folder, name, "status_flags")),
        local_position=ColumnsOnDisk(table_file(folder, name, "local_position")),
        states=partial(read_states, folder, name),
        steps=partial(read_steps, folder, name) if _has_steps(table_file(folder, name, "states")) else None,
        withheld=partial(read_columns, withheld) if withheld.exists() else None,
        gaps=partial(read_columns, gaps) if gaps.exists() else None,
    )


def read_innovations(
    path: AnyPath, parameters: Mapping[str, float], spool: SampleSpool | None = None
) -> SpooledSamples:
    """Read an innovations table, split by source and axis; sources that measure nothing are left out.

    Innovations of reconstructed samples are left out, too: they are no witnesses.

    Parameters
    ----------
    parameters : of this set; where the table has no test ratio, it follows from the source's gate
    spool : where the samples are kept; by default in a nameless file in the folder of the table
    """
    samples = SpooledSamples(spool or SampleSpool(Path(path).parent), partial(gate_of, parameters))
    for piece in read_pieces(path, sealed=False):
        samples.add(piece)
    return samples


def read_states(folder: AnyPath, name: str) -> FilterStates:
    """Read the states of a set.

    Raises
    ------
    UserError
        If the file is missing or damaged.
    """
    return joined_states(_state_pieces(table_file(folder, name, "states"), STATE_BLOCKS))


def read_steps(folder: AnyPath, name: str) -> ReplayedSteps:
    """Read the states of a set with the IMU that they were predicted with; errors as for `read_states`."""
    return joined_steps(_state_pieces(table_file(folder, name, "states"), STEP_BLOCKS))


def _has_steps(path: Path) -> bool:
    names = {*read_schema(path, sealed=False).names}
    return names.issuperset(column for block in STEP_BLOCKS.values() for column in block.columns)


def _state_pieces(path: Path, blocks: Mapping[str, Block]) -> Iterator[Columns]:
    columns = ["timestamp_sample", *(column for block in blocks.values() for column in block.columns)]
    for table in read_pieces(path, columns, sealed=False):
        piece = columns_of(table)
        yield {
            "time": piece["timestamp_sample"],
            **{name: block.of_columns(piece) for name, block in blocks.items()},
        }
