"""Barometer samples between those that a thinned log holds: on the straight line between their neighbours."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.reconstruction.between_samples import NewRows, interpolate, share_of_way
from fusetune.px4.flight import TopicTable

INTERPOLATED = ("baro_alt_meter", "rho", "baro_temp_celcius", "baro_pressure_pa")


def interpolate_barometer(table: TopicTable, rate_hz: float, max_bridge_s: float) -> tuple[TopicTable, np.ndarray]:
    """Canonical `vehicle_air_data` at a higher rate; all else as of `interpolate`."""

    def on_the_line(sampled: np.ndarray, time: np.ndarray, place: np.ndarray) -> NewRows:
        share = share_of_way(sampled, time, place)
        values = {}
        for name in INTERPOLATED:
            if name in table:
                column = table[name].astype(np.float64)
                values[name] = column[place - 1] + share * (column[place] - column[place - 1])
        return time, place, values

    return interpolate(table, rate_hz, max_bridge_s, on_the_line)
