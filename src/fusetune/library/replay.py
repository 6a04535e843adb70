"""One replay of a log, as tables."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from fusetune.analyze.replaying.prepared_flight import PreparedFlight
from fusetune.analyze.replaying.store.columns import (
    flags_table,
    innovation_table,
    local_position_table,
    prediction_table,
)
from fusetune.ekf2.filter.common import state
from fusetune.ekf2.replay.results import ReplayResult
from fusetune.px4.aid_sources import AID_SOURCES, AXES

_AXES_OF_BLOCK = {"quaternion": "wxyz", "wind": "ne"}
_NED = {"velocity", "position", "mag_earth"}


class Replay:
    """What EKF2 did with a log under a set of parameters, made by `Log.replay`.

    All tables have `time_s`, seconds since the log began. Units are SI, the frame NED, that of the body FRD, as in PX4.
    """

    def __init__(self, prepared: PreparedFlight, overrides: Mapping[str, float], start_timestamp: int) -> None:
        self._prepared = prepared
        self._overrides = dict(overrides)
        self._start = start_timestamp
        self._params = prepared.parameters(overrides)

    def __repr__(self) -> str:
        changed = ", ".join(f"{name} {value:g}" for name, value in self._overrides.items())
        return f"<Replay of {self._prepared.flight.name} with {changed or 'the parameters that flew'}>"

    @property
    def release(self) -> str:
        """The release of PX4 whose EKF2 it is, such as "v1.16" or "main"."""
        return self._prepared.release

    @property
    def parameters(self) -> dict[str, float]:
        """All EKF2 parameters that were used."""
        return dict(self._params)

    @cached_property
    def innovations(self) -> pd.DataFrame:
        """One row per sample and axis that an aid source was given.

        Columns `time_s`, `source`, `axis` ("x", "y", "z"; "" where the source has one), `timestamp_sample` (µs),
        `observation`, `observation_variance`, `innovation`, `innovation_variance` (its unit and unit²), `test_ratio`
        (above 1 the sample is rejected), `innovation_rejected`, `fused`, and `measured`: False where the log lacks the
        sample and the replay made it up.
        """
        result, measured = self._result
        table = self._table(innovation_table(result.innovations, measured), "timestamp_sample")
        single = table["source"].map({name: one.axes == 1 for name, one in AID_SOURCES.items()}).astype(bool)
        table["axis"] = np.where(single, "", np.array(AXES)[table["axis"]])
        return table

    @cached_property
    def states(self) -> pd.DataFrame:
        """One row per update of the filter, on the fusion time horizon: each state and, `sigma_…`, its standard
        deviation.

        `quaternion_w` … (body to NED), `velocity_n/e/d` (m/s), `position_n/e/d` (m), `gyro_bias_x/y/z` (rad/s),
        `accel_bias_x/y/z` (m/s²), `mag_earth_n/e/d` and `mag_body_x/y/z` (gauss), `wind_n/e` (m/s), `terrain` (m);
        `sigma_attitude_n/e/d` (rad) is of the rotation in NED.
        """
        rows = self._result[0].states
        columns: dict[str, Any] = {"timestamp_sample": np.ascontiguousarray(rows["timestamp_sample"])}
        for block, (first, size) in state.PUBLISHED_STATE_BLOCKS.items():
            for i, name in enumerate(_names(block, size)):
                columns[name] = np.ascontiguousarray(rows["states"][:, first + i])
        for block, (first, size) in state.ERROR_STATE_BLOCKS.items():
            for i, name in enumerate(_names(block, size)):
                columns[f"sigma_{name}"] = np.sqrt(np.maximum(rows["covariances"][:, first + i], 0.0))
        return self._table(pa.table(columns), "timestamp_sample")

    @cached_property
    def local_position(self) -> pd.DataFrame:
        """One row per update: what the output predictor publishes, with the fields of `vehicle_local_position`."""
        return self._table(local_position_table(self._result[0].local_position), "timestamp")

    @cached_property
    def flags(self) -> pd.DataFrame:
        """Flags of the filter, as in `estimator_status_flags`: one row per change, at least one a second."""
        return self._table(flags_table(self._result[0].flags), "timestamp")

    @cached_property
    def withheld(self) -> pd.DataFrame:
        """How far predictions were off after seconds without a sensor, of gaps in which it was kept from the filter."""
        return prediction_table(self._result[0].gaps).to_pandas()

    @property
    def resets(self) -> dict[str, int]:
        """How often each part of the state was reset, by the names of `vehicle_local_position`."""
        return dict(self._result[0].resets)

    @cached_property
    def summary(self) -> pd.DataFrame:
        """One row per source and axis of what was measured in the log.

        `n`, `rms` (of the innovation, its unit), `mean_nis` (mean of innovation² over its variance: 1 where the
        variance tells the truth), `nll` (negative log-likelihood per sample, nat), `rejected` (share).
        """
        table = self.innovations
        if "measured" in table:
            table = table[table["measured"]]
        square = table["innovation"].astype(float) ** 2
        variance = table["innovation_variance"].astype(float)
        rows = table[["source", "axis"]].assign(
            square=square,
            nis=square / variance,
            nll=0.5 * (square / variance + np.log(2.0 * np.pi * variance)),
            rejected=table["innovation_rejected"].astype(float),
        )
        grouped = rows.groupby(["source", "axis"], observed=True, sort=False)
        means = grouped.mean()
        return pd.DataFrame(
            {
                "n": grouped.size(),
                "rms": np.sqrt(means["square"]),
                "mean_nis": means["nis"],
                "nll": means["nll"],
                "rejected": means["rejected"],
            }
        ).reset_index()

    @cached_property
    def _result(self) -> tuple[ReplayResult, np.ndarray]:
        return self._prepared.replay(self._params, frozenset(self._overrides))

    def _table(self, table: pa.Table, clock: str) -> pd.DataFrame:
        frame = table.to_pandas()
        frame.insert(0, "time_s", (frame[clock].to_numpy(np.int64) - self._start) * 1e-6)
        return frame


def _names(block: str, size: int) -> list[str]:
    if size == 1:
        return [block]
    letters = _AXES_OF_BLOCK.get(block, "ned" if block in _NED or block == "attitude" else "xyz")
    return [f"{block}_{letter}" for letter in letters]
