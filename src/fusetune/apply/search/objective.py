"""What a search makes small: the score of the decision, with what a set may not pay for it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fusetune.apply.evidence import AIDED, UNAIDED
from fusetune.apply.search.comparison import Comparison

Array = npt.NDArray[np.float64]

_OBJECTED, _UNKNOWN = 0.1, 1.0
"""Added, nat, to sets that the decision would rule out; the score of sets that have none."""


def objective(compared: Comparison) -> Array:
    """(N,) what is made small, nat; 0 is the base.

    The mean score over the flights, and once more what the set is worse by in one-step predictions or in those without
    GNSS: neither aim is paid for with the other.
    """
    found = compared.means.copy()
    for aim in (AIDED, UNAIDED):
        values = compared.aims[aim][:, compared.usable]
        there = np.isfinite(values).any(axis=0)
        if there.any():
            found += np.maximum(values[:, there].mean(axis=1), 0.0)
    ruled_out = np.array([bool(one) for one in compared.objections], dtype=bool)
    found[ruled_out] = np.maximum(found[ruled_out], 0.0) + _OBJECTED
    return np.where(np.isfinite(found), found, _UNKNOWN)
