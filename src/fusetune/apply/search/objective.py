"""What a search makes small: the score of the decision, with what a set may not pay for it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from fusetune.apply.evidence import AIDED, SMOOTHED, UNAIDED
from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.plan import OF_DELAYS
from fusetune.apply.search.requests import Ask

Array = npt.NDArray[np.float64]

_SMOOTHED_SHARE = 0.2
"""With it the order of sets near the best is the truth's in two simulated worlds (docs/search.md); with more the noise
of GNSS velocity becomes too small where the receiver's error is white."""

_OBJECTED, _UNKNOWN = 0.1, 1.0
"""Added, nat, to sets that the decision would rule out; the score of sets that have none."""


def objective(compared: Comparison, stage: str) -> Array:
    """(N,) what is made small, nat; 0 is the base.

    The mean score over the flights; once more what the set is worse by in one-step predictions or in those without
    GNSS, so that neither aim is paid for with the other; and a share of the difference to the smoothed velocity. That
    follows the true velocity where the score hardly moves, for the noise of the receiver is in every prediction of it.
    Of delays and lever arms it says nothing: it is made with those of the base.
    """
    found = compared.means.copy()
    for aim in (AIDED, UNAIDED):
        found += np.maximum(aim_means(compared, aim), 0.0)
    if stage not in OF_DELAYS:
        found += _SMOOTHED_SHARE * aim_means(compared, SMOOTHED)
    ruled_out = np.array([bool(one) for one in compared.objections], dtype=bool)
    found[ruled_out] = np.maximum(found[ruled_out], 0.0) + _OBJECTED
    return np.where(np.isfinite(found), found, _UNKNOWN)


def lowest_on_all(asks: Sequence[tuple[Sequence[str], Ask]], answers: Sequence[Comparison]) -> float:
    """The lowest of what the search on all flights, which asks first, makes small in a round; 0 is the base."""
    return float(objective(answers[0], asks[0][1].stage).min(initial=0.0))


def aim_means(compared: Comparison, aim: str) -> Array:
    """(N,) mean difference in one kind of prediction, over the flights that have it; 0 where none has."""
    values = compared.aims[aim][:, compared.usable]
    there = np.isfinite(values).any(axis=0)
    return np.asarray(values[:, there].mean(axis=1) if there.any() else np.zeros(len(values)))
