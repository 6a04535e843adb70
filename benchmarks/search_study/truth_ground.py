"""The search's ground with the truth on it: the oracle is the same search, told the true errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from fusetune.analyze.delays.velocity_place import VelocityPlace
from fusetune.apply.evidence import AIDED, AIMS, UNAIDED
from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.requests import Ask

from .true_figures import FIGURES, KeptFigures

Array = npt.NDArray[np.float64]

AIM_OF = {AIDED: FIGURES.index("velocity"), UNAIDED: FIGURES.index("drift")}
"""The true figure that stands for each of the two aims of a score."""


class TruthGround:
    """Compares sets by the logarithm of their true errors of velocity and drift, each half.

    Parameters
    ----------
    names : of the flights, in the order of `kept`
    place : delay and place of the antenna as they are; None where the vehicle is told both right
    """

    def __init__(self, kept: KeptFigures, names: Sequence[str], place: VelocityPlace | None = None) -> None:
        self._kept, self._places = kept, {name: place for place, name in enumerate(names)}
        self._place = place

    def compare(self, asks: Sequence[tuple[Sequence[str], Ask]]) -> list[Comparison]:
        """Compare the sets of each ask with its base on some flights."""
        return [self._compared(flights, ask) for flights, ask in asks]

    def _compared(self, flights: Sequence[str], ask: Ask) -> Comparison:
        places = [self._places[name] for name in flights]
        base = self._kept.figures(dict(ask.base), places)
        rows = [self._kept.figures(dict(one), places) for one in ask.sets]
        compared = compared_by_truth(np.array(rows).reshape(len(rows), *base.shape), base)
        return replace(compared, places=(self._place,) * len(places))


def compared_by_truth(figures: Array, base: Array) -> Comparison:
    """Sets (N, F, 4) and their base (F, 4) compared; a flight too short for a gap has velocity alone.

    A set without a figure that its base has is none.
    """
    logs = np.log(figures) - np.log(base)
    aims = {aim: np.full(logs.shape[:2], np.nan) for aim in AIMS} | {aim: logs[..., at] for aim, at in AIM_OF.items()}
    asked = np.isfinite(base[:, list(AIM_OF.values())])
    values = np.where(asked, logs[..., list(AIM_OF.values())], 0.0)
    differences = values.sum(axis=-1) / np.maximum(asked.sum(axis=-1), 1)
    return Comparison(differences, aims, tuple(() for _ in range(len(logs))))


def change_percent(kept: KeptFigures, values: Mapping[str, float], flights: Sequence[int]) -> Array:
    """(4,) by how much the mean true errors of a set are larger than the present set's, %."""
    own, present = (kept.figures(one, flights).mean(axis=0) for one in (values, {}))
    return np.asarray(100.0 * (own / present - 1.0))
