"""Which parameters keep their present value."""

from __future__ import annotations

import numpy as np
import pytest

from fusetune.apply.evidence import AIDED, SMOOTHED, UNAIDED
from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.putting_back import fewest_changes
from fusetune.design.search_settings import SearchSettings

SETTINGS = SearchSettings()


def compared(means: list[float], smoothed: list[float], spread: float = 0.0) -> Comparison:
    """Sets of whose differences the standard error over four flights is `spread` / √3."""
    chance = spread * np.array([1.0, -1.0, 1.0, -1.0])
    rows = np.array([np.full(4, one) + (place > 0) * chance for place, one in enumerate(means)])
    flat = np.full(rows.shape, np.nan)
    aims = {AIDED: flat, UNAIDED: flat, SMOOTHED: np.array([np.full(4, one) for one in smoothed])}
    return Comparison(rows, aims, ((),) * len(means))


@pytest.mark.parametrize(
    ("means", "smoothed", "spread", "stage", "place"),
    [
        # a percent is 0.00995 nat; the objective has a fifth of the smoothed velocity
        ([-0.3, -0.295, -0.28], [-0.3, -0.3, -0.3], 0.0, "all", 1),
        # 0.02 is more than a percent, but no more than one standard error, nor a tenth of the gain of 0.3
        ([-0.3, -0.295, -0.28], [0.0, 0.0, 0.0], 0.04, "all", 2),
        # of a gain of 0.1 a tenth is a percent
        ([-0.1, -0.095, -0.08], [0.0, 0.0, 0.0], 0.04, "all", 1),
        # hardly worse in the score, but by 3.5 % in the smoothed velocity, 0.7 % of the objective
        ([-0.3, -0.3], [-0.3, -0.265], 0.0, "all", 0),
        # of delays and lever arms the smoothed velocity says nothing
        ([-0.3, -0.3], [-0.3, -0.1], 0.0, "delays again", 1),
        # one that costs too much alone may cost little with the next
        ([-0.3, -0.28, -0.299], [0.0, 0.0, 0.0], 0.0, "all", 2),
        ([-0.3], [0.0], 0.0, "all", 0),
    ],
)
def test_as_many_as_cost_little_are_put_back(
    means: list[float], smoothed: list[float], spread: float, stage: str, place: int
) -> None:
    assert fewest_changes(compared(means, smoothed, spread), stage, SETTINGS) == place
