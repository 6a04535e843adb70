"""Samples that are scored, as `samples.parquet` of a flight holds them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_pieces


class ScoredSamples(NamedTuple):
    """Rows that lie together: some samples of one set, source and axis in the order of time.

    Attributes
    ----------
    columns : those that were asked for, each (N,)
    """

    set_name: str
    source: str
    axis: int
    columns: tuple[npt.NDArray, ...]


def scored_samples(path: AnyPath, columns: Sequence[str]) -> Iterator[ScoredSamples]:
    """Read `samples.parquet` a piece at a time.

    Raises
    ------
    UserError
        The file is missing or damaged.
    """
    for table in read_pieces(path, ["set", "source", "axis", *columns]):
        sets, sources = (table[name].combine_chunks() for name in ("set", "source"))
        axis = table["axis"].to_numpy()
        values = [table[name].to_numpy() for name in columns]
        key = np.stack([sources.indices.to_numpy(), axis, sets.indices.to_numpy()])
        changes = np.flatnonzero((np.diff(key) != 0).any(axis=0)) + 1
        for start, stop in pairwise([0, *changes.tolist(), len(axis)] if len(axis) else []):
            rows = tuple(one[start:stop] for one in values)
            yield ScoredSamples(sets[start].as_py(), sources[start].as_py(), int(axis[start]), rows)
