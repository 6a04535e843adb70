"""Columns of the tables of scores: those that all begin with, and several of one type at once."""

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt
import pyarrow as pa


def columns_of(kind: pa.DataType, *names: str) -> tuple[pa.Field, ...]:
    """Columns of one type."""
    return tuple(pa.field(name, kind) for name in names)


FLIGHT_AND_SET = columns_of(pa.string(), "flight", "set")

BY_AXIS = (*FLIGHT_AND_SET, *columns_of(pa.string(), "source", "axis"))
"""Axes and groups of axes, by name."""

SOURCE_AND_AXIS = (pa.field("source", pa.string()), pa.field("axis", pa.int32()))
"""Axes by their place among those of their source."""


def repeated(name: str, rows: int) -> pa.Array:
    """A column with one text in all rows."""
    return pa.repeat(pa.scalar(name, pa.string()), rows)


def texts_repeated(names: Sequence[str], rows: npt.NDArray[np.int64]) -> pa.Array:
    """A column with each text in so many rows, one after the other."""
    return pa.array(names, pa.string()).take(pa.array(np.repeat(np.arange(len(names), dtype=np.int32), rows)))


def parted(table: pa.Table, rows: Sequence[int]) -> Iterator[pa.Table]:
    """So many rows of a table after the other."""
    first = 0
    for count in rows:
        yield table.slice(first, count)
        first += count
