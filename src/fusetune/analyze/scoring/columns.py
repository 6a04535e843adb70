"""Columns of the tables of scores: those that all begin with, and several of one type at once."""

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
