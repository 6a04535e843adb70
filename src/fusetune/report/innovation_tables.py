"""What the innovations of all flights say of the sets, as tables that charts, figures and sections share."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pandas as pd

from fusetune.analyze.metrics import break_rate
from fusetune.apply.paper_mode import PAPER_VARIABLES
from fusetune.px4.aid_sources import AID_SOURCES, AXES, REPORTED_SOURCES
from fusetune.report.results import PooledSamples, Results, figure_values

Array = npt.NDArray[np.float64]

CONSISTENCY_GROUPS = tuple((source.name, source.groups[-1][0]) for source in REPORTED_SOURCES)
"""Source and group of axes whose consistency is judged."""

BREAK_METRICS = {metric.name: metric.label for metric in break_rate.METRICS}

BOX_PERCENTILES = (5.0, 25.0, 50.0, 75.0, 95.0)
"""Whisker, box, median, box, whisker."""

CONSISTENT_WHISKER = 1.64
"""Where the whiskers of innovations lie that are divided by their standard deviation, of a filter that knows it."""


def rms_table(results: Results) -> pd.DataFrame:
    """RMS innovation by variable (rows, names of the paper's table 12) and set (columns), mean over flights."""
    rows = {}
    for variable, places in PAPER_VARIABLES.items():
        means = [_set_means(results, *place) for place in places]
        rows[variable] = {name: next((one[name] for one in means if name in one), math.nan) for name in results.shown}
    return pd.DataFrame.from_dict(rows, orient="index", columns=list(results.shown))


def _set_means(results: Results, source: str, axis: str) -> dict[str, float]:
    """RMS innovation of a source and axis by set, mean over flights."""
    rows = figure_values(results, source, axis, "rms_innovation")
    return {str(name): float(mean) for name, mean in rows.groupby("set", observed=True)["value"].mean().items()}


def box_figures(samples: PooledSamples, sets: tuple[str, ...], *, normalised: bool) -> dict[str, Array]:
    """`BOX_PERCENTILES` of each set that has samples, (5,), in the order of the sets."""
    values = samples.normalised if normalised else samples.innovation
    return {name: np.percentile(values[name], BOX_PERCENTILES) for name in sets if name in values}


def consistency_rows(results: Results) -> list[tuple[str, str, pd.DataFrame]]:
    """Source, group of axes and mean NIS of each flight and set with its bounds, of the sources that have any."""
    found = [(*one, figure_values(results, *one, "mean_nis_effective")) for one in CONSISTENCY_GROUPS]
    return [one for one in found if len(one[2])]


def break_sources(results: Results) -> list[str]:
    """Sources whose fusion breaks were counted."""
    return [name for name, _ in CONSISTENCY_GROUPS if len(figure_values(results, name, "x", "break_rate_gate"))]


def pooled_breaks(results: Results, source: str, metric: str) -> dict[str, tuple[int, int]]:
    """Breaks and samples by set over all axes and flights."""
    axes = AXES[: AID_SOURCES[source].axes]
    rows = pd.concat([figure_values(results, source, axis, metric) for axis in axes])
    counts = (rows["value"] * rows["n"]).groupby(rows["set"], observed=True).sum()
    samples = rows["n"].groupby(rows["set"], observed=True).sum()
    return {str(name): (round(counts[name]), round(samples[name])) for name in samples.index}
