"""Figures of the metrics of all sets at once, each the mean over the flights that have it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from fusetune.px4.aid_sources import AXES
from fusetune.storage.words import places, words_of

Array = npt.NDArray[np.float64]
Place = tuple[str, str, str]
"""Source, axis and metric."""


class MeanFigures:
    """Means over flights, by source, axis and metric; NaN where a set has none.

    Parameters
    ----------
    metrics : columns of `METRICS_SCHEMA`
    flights : that count, by name
    sets : S names, in the order of the figures
    metric_names : that are asked for
    """

    def __init__(
        self, metrics: pa.Table, flights: Sequence[str], sets: Sequence[str], metric_names: Sequence[str]
    ) -> None:
        asked = {"flight": flights, "set": sets, "metric": metric_names}
        kept = metrics.filter(
            _all(pc.is_in(metrics[name], value_set=pa.array(values, pa.string())) for name, values in asked.items())
        )
        self._unknown = np.full(len(sets), np.nan)
        self._of: dict[Place, Array] = {}
        place = {name: places(kept[name], values) for name, values in asked.items()}
        sources, source = words_of(kept["source"])
        axes, axis = words_of(kept["axis"])
        value = kept["value"].to_numpy()
        column, found = _together(source, axis, place["metric"])
        order = np.argsort(column, kind="stable")
        starts = np.searchsorted(column[order], np.arange(len(found) + 1))
        for number, (one, on, metric) in enumerate(found):
            rows = order[starts[number] : starts[number + 1]]
            table = np.full((len(sets), len(flights)), np.nan)
            table[place["set"][rows], place["flight"][rows]] = value[rows]
            self._of[sources[one], axes[on], metric_names[metric]] = of_known(table, np.mean)

    def of(self, source: str, axis: str, metric: str) -> Array:
        """(S,) means of a figure."""
        return self._of.get((source, axis, metric), self._unknown)

    def by_axis(self, sources: Sequence[str], metric: str) -> Array:
        """(S, N) means of a figure of sources, axis by axis."""
        return np.column_stack([self.of(source, axis, metric) for source in sources for axis in AXES])


def of_known(figures: Array, reduced: Callable[..., Any]) -> Array:
    """(S,) what a function such as `np.mean` makes of the figures (S, N) of each row that are known; NaN of none."""
    known = np.isfinite(figures)
    found = np.full(len(figures), np.nan)
    some = known.any(axis=0)
    whole = known[:, some].all(axis=1) & some.any()
    if whole.any():
        found[whole] = reduced(np.ascontiguousarray(figures[whole][:, some]), axis=1)
    for row in np.flatnonzero(~whole & known.any(axis=1)).tolist():
        found[row] = reduced(figures[row][known[row]])
    return found


def _all(conditions: Any) -> Any:
    first, *others = conditions
    for one in others:
        first = pc.and_(first, one)
    return first


def _together(*codes: npt.NDArray[np.integer]) -> tuple[npt.NDArray[np.intp], list[tuple[int, ...]]]:
    """(N,) one code for several, and what each of them stands for."""
    shape = tuple(int(one.max(initial=0)) + 1 for one in codes)
    found, code = np.unique(np.ravel_multi_index(codes, shape), return_inverse=True)
    return code, list(zip(*(one.tolist() for one in np.unravel_index(found, shape)), strict=True))
