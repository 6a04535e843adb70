"""What counts as equal: scores that differ by less than rounding are the same score."""

import numpy as np
import numpy.typing as npt

EQUAL_WITHIN = 1e-9
"""Difference of scores, nat: a billionth of a prediction error, while innovations are kept to a part in 10⁷."""


def without_rounding(differences: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Differences of scores, those within rounding set to 0."""
    values = np.asarray(differences, dtype=np.float64)
    return np.where(np.abs(values) <= EQUAL_WITHIN, 0.0, values)
