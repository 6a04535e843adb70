"""Barometer samples between those that a thinned log holds: on the straight line between their neighbours."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.reconstruction.between_samples import insert_rows, insertion_times
from fusetune.px4.flight import TopicTable, row_count

INTERPOLATED = ("baro_alt_meter", "rho", "baro_temp_celcius", "baro_pressure_pa")


def interpolate_barometer(table: TopicTable, rate_hz: float, max_bridge_s: float) -> tuple[TopicTable, np.ndarray]:
    """Interpolate `vehicle_air_data` to a higher rate.

    Parameters
    ----------
    table : canonical `vehicle_air_data`
    rate_hz : samples are placed evenly between two measured ones, this many a second at most
    max_bridge_s : measured samples that are further apart stay as they are

    Returns
    -------
    The table, and for each of its rows whether it was measured.
    """
    time, place = insertion_times(table, rate_hz, max_bridge_s)
    if not len(time):
        return table, np.ones(row_count(table), np.bool_)
    sampled = table["timestamp_sample"].astype(np.int64)
    share = (time - sampled[place - 1]) / (sampled[place] - sampled[place - 1])
    values = {}
    for name in INTERPOLATED:
        if name in table:
            column = table[name].astype(np.float64)
            values[name] = column[place - 1] + share * (column[place] - column[place - 1])
    return insert_rows(table, time, place, values)
