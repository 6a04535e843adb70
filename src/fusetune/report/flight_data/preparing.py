"""Panels made ready to be packed: in the order of time, counted, and no finer than the finest that is ever shown.

Of an hour of flight a series has hundreds of thousands of samples, and there are hundreds of series. What is kept of
one is taken before the next is made; every later thinning takes the smallest and the largest out of these.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fusetune.report.flight_data.content import Panel, Series
from fusetune.report.flight_data.thinning import kept_rows

FINEST = 1000
"""Buckets of a series at most: twice as many points fill any screen, and half of a doubly zoomed one."""


def prepared(panel: Panel, start_us: int) -> Panel:
    """The panel with its series made ready.

    Parameters
    ----------
    start_us : when the log begins; what it holds of before, as for a sensor's delay, is left out
    """
    return replace(panel, series=tuple(_prepared(one, start_us) for one in panel.series))


def _prepared(series: Series, start_us: int) -> Series:
    if np.any(np.diff(series.time) < 0):
        series = series.rows(np.argsort(series.time, kind="stable"))
    if series.time.size and series.time[0] < start_us:
        series = series.rows(slice(int(np.searchsorted(series.time, start_us)), None))
    counted = replace(
        series,
        samples=int(np.count_nonzero(np.isfinite(series.values))),
        rejected_samples=None if series.rejected is None else int(np.count_nonzero(series.rejected)),
    )
    rows = kept_rows_of(counted, FINEST)
    return counted if rows.size == series.time.size else counted.rows(rows)


def kept_rows_of(series: Series, buckets: int) -> np.ndarray:
    """Rows of a series that stay, see `fusetune.report.flight_data.thinning`."""
    return kept_rows(series.values, buckets, () if series.peaks is None else (series.peaks,), series.rejected)
