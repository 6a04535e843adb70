"""Columns of few different words, as Arrow's tables hold them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pyarrow as pa


def words_of(column: pa.ChunkedArray) -> tuple[list[str], npt.NDArray[np.integer]]:
    """The different words of a column, and (N,) the place of each row's among them; the column has no gaps."""
    whole = column.unify_dictionaries().combine_chunks()
    whole = whole if pa.types.is_dictionary(whole.type) else whole.dictionary_encode()
    return whole.dictionary.to_pylist(), whole.indices.to_numpy()


def texts(column: pa.ChunkedArray) -> list[str]:
    """(N,) the column as it reads; Arrow's own way takes longer for each row of a dictionary."""
    words, codes = words_of(column)
    return [words[code] for code in codes.tolist()]


def places(column: pa.ChunkedArray, words: Sequence[str]) -> npt.NDArray[np.int64]:
    """(N,) the place of each row's word in a sequence of words, −1 where it is none of them."""
    held, codes = words_of(column)
    place = {word: number for number, word in enumerate(words)}
    return np.array([place.get(word, -1) for word in held], np.int64)[codes]
