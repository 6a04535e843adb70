"""Few changes: parameters are put back to the present value as long as that costs little."""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from fusetune.apply.evidence import SMOOTHED
from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.objective import objective
from fusetune.apply.search.plan import OF_DELAYS
from fusetune.apply.search.requests import Ask, ask_for
from fusetune.apply.search.space import Space
from fusetune.design.search_settings import SearchSettings

Array = npt.NDArray[np.float64]

_SHARE_OF_GAIN = 0.1
"""Putting back costs no more than this share of the gain, however large the standard error is."""

_SMOOTHED_TIMES = 3.0
"""In the smoothed velocity it may cost so many times as much: 1 % of the score, in which the receiver's noise is, was 3
to 4 % of the true velocity error in simulated worlds, and the smoothed velocity follows that."""


def put_back(
    space: Space,
    best: dict[str, float],
    base: Mapping[str, float],
    present: Mapping[str, float],
    changed: Sequence[str],
    settings: SearchSettings,
    stage: str,
) -> Generator[Ask, Comparison, dict[str, float]]:
    """Put parameters back, the one that costs least alone first.

    Parameters
    ----------
    best : the set before
    changed : names of those that may be put back
    stage : by whose objective costs are counted

    Yields
    ------
    Two asks: each alone, then more and more together
    """
    alone = yield ask_for(stage, space, base, [best, *(best | {name: present[name]} for name in changed)])
    scores = objective(alone, stage)
    costs = dict(zip(changed, (scores[1:] - scores[0]).tolist(), strict=True))
    order = sorted(changed, key=lambda name: costs[name])
    nested = [best | {name: present[name] for name in order[: count + 1]} for count in range(len(order))]
    together = yield ask_for(stage, space, base, [best, *nested])
    return [best, *nested][fewest_changes(together, stage, settings)]


def fewest_changes(compared: Comparison, stage: str, settings: SearchSettings) -> int:
    """Place of the last of sets, each with one more parameter put back, that is hardly worse than the first."""
    scores = objective(compared, stage)
    rows = compared.differences[:, compared.usable]
    smoothed = compared.aims[SMOOTHED][:, compared.usable]
    gain = max(-float(scores[0]), 0.0)
    matters = math.log1p(0.01 * settings.putting_back_percent)
    chosen = 0
    for place in range(1, len(scores)):
        little = max(matters, min(_error(rows[place] - rows[0]), _SHARE_OF_GAIN * gain))
        if scores[place] - scores[0] > little:
            continue
        steps = smoothed[place] - smoothed[0]
        steps = steps[np.isfinite(steps)]
        if stage in OF_DELAYS or not steps.size or steps.mean() <= max(_SMOOTHED_TIMES * matters, _error(steps)):
            chosen = place
    return chosen


def _error(steps: Array) -> float:
    """Standard error of the mean over the flights; 0 of a single one."""
    return float(np.std(steps, ddof=1) / math.sqrt(steps.size)) if steps.size > 1 else 0.0
