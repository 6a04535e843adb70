"""Records compared exactly."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np


def assert_equal_rows(left: np.ndarray, right: np.ndarray, names: Iterable[str] | None = None) -> None:
    """Field by field, bit by bit (the padding between fields is not part of the result); NaN equals NaN."""
    assert left.dtype == right.dtype
    if left.dtype.names is None:
        np.testing.assert_array_equal(left, right)
        return
    for name in names or left.dtype.names:
        np.testing.assert_array_equal(left[name], right[name], err_msg=name)
