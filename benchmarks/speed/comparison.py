"""Two revisions measured in turns: what became slower, and by how much."""

from __future__ import annotations

import statistics
from dataclasses import dataclass

from benchmarks.speed.quantities import TOLERANCES, Quantity
from benchmarks.speed.results import Samples


@dataclass(frozen=True)
class Comparison:
    """A quantity on the revision at hand over that on another."""

    ratio: float
    """Of the medians, each as a multiple of the calibration loop of its run."""
    is_regression: bool
    """Worse by more than the tolerance, and its best repeat is worse than the other's worst."""


def compare(quantity: Quantity, new: Samples, old: Samples) -> Comparison:
    """Compare samples of the same number of repeats."""
    news, olds = new.calibrated(quantity), old.calibrated(quantity)
    centre_new, centre_old = statistics.median(news), statistics.median(olds)
    best, worst = (max, min) if quantity.more_is_better else (min, max)
    beyond = quantity.worse_by(centre_new, centre_old) > TOLERANCES[quantity.kind]
    apart = quantity.worse_by(best(news), worst(olds)) > 0.0
    return Comparison(centre_new / centre_old if centre_old else float("nan"), beyond and apart)
