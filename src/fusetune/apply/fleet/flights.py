"""What the table of all flights' health says, as one matrix: a row per flight, a column per figure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import get_args

import numpy as np
import numpy.typing as npt
import pandas as pd

from fusetune.finding import Severity
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_table

Array = npt.NDArray[np.float64]

SEVERITIES: tuple[Severity, ...] = get_args(Severity)
"""From nothing to all; a severity is counted by its place here."""

OF_FLIGHT = "flight"
"""Group of figures that say what was flown; they are no matter of health."""
BIT_FIELDS = ("filter.faults",)
"""Figures that are flags: judged, and no quantity that could be spread or change."""
WORTH_A_LOOK = 0.05
"""A rate that is 199.9 Hz on all flights and 199.8 Hz on one is another beyond doubt, and nobody's concern."""

_COLUMNS = (
    "flight",
    "vehicle",
    "firmware",
    "date",
    "mission",
    "id",
    "group",
    "instance",
    "origin",
    "severity",
    "figure",
    "threshold",
    "unit",
)


@dataclass(frozen=True)
class FleetFlight:
    """One flight of the fleet; `date` is ISO 8601 in UTC, empty where the log does not tell."""

    name: str
    vehicle: str
    firmware: str
    mission: str
    date: str

    @property
    def month(self) -> str:
        """Of the date, as `2026-08`."""
        return self.date[:7]


@dataclass(frozen=True)
class FigureName:
    """A figure of the health table: its id there, what it belongs to, its unit, and its limit where it has one."""

    id: str
    group: str
    unit: str
    limit: float | None

    def matters(self, value: float, usual: float) -> bool:
        """Whether a difference is worth a look, however sure it is: `WORTH_A_LOOK` of the usual value and the limit."""
        return abs(value - usual) > WORTH_A_LOOK * max(abs(usual), abs(self.limit or 0.0))


@dataclass(frozen=True)
class FleetTable:
    """The health of all flights.

    Attributes
    ----------
    flights : F flights by date, those without a date last
    figures : K figures in the order of the health table
    values : (F, K), NaN where a flight does not tell the figure, and of `BIT_FIELDS`
    severities : (F, K), places in `SEVERITIES`
    """

    flights: tuple[FleetFlight, ...]
    figures: tuple[FigureName, ...]
    values: Array
    severities: npt.NDArray[np.int8]

    def rows_of(self, vehicle: str) -> npt.NDArray[np.intp]:
        """Rows of the flights of one vehicle."""
        return np.flatnonzero([one.vehicle == vehicle for one in self.flights])

    @property
    def vehicles(self) -> tuple[str, ...]:
        """In the order of their first flights."""
        return tuple(dict.fromkeys(one.vehicle for one in self.flights))


def read_fleet_table(health_table: AnyPath) -> FleetTable:
    """Read `results/analyze/health.parquet`.

    Of a figure that several estimators, sensors or both vehicle and replay tell, the vehicle's own counts before the
    replay's, of those the worst judged, of those the first instance.

    Raises
    ------
    UserError
        The file is missing or damaged.
    """
    rows = read_table(health_table, list(_COLUMNS)).to_pandas()
    flights = tuple(sorted(_flights(rows), key=lambda one: (one.date == "", one.date, one.name)))
    rows = rows[rows["severity"] != SEVERITIES[0]]
    rows = rows.assign(
        rank=rows["severity"].map({name: place for place, name in enumerate(SEVERITIES)}),
        is_replayed=rows["origin"] == "replay",
    )
    names = _figure_names(rows)
    order = rows.sort_values(["is_replayed", "rank", "instance"], ascending=[True, False, True], na_position="first")
    kept = order.drop_duplicates(["flight", "id", "unit"])
    row = kept["flight"].map({one.name: place for place, one in enumerate(flights)}).to_numpy()
    places = {(one.id, one.unit): place for place, one in enumerate(names)}
    column = np.array([places[key] for key in zip(kept["id"], kept["unit"], strict=True)], dtype=np.intp)
    values = np.full((len(flights), len(names)), np.nan)
    severities = np.zeros(values.shape, dtype=np.int8)
    if len(kept):
        found = kept["figure"].where(~kept["id"].isin(BIT_FIELDS)).to_numpy(dtype=np.float64)
        values[row, column] = np.where(np.isfinite(found), found, np.nan)
        severities[row, column] = kept["rank"].to_numpy(dtype=np.int8)
    return FleetTable(flights, names, values, severities)


def _flights(rows: pd.DataFrame) -> Iterator[FleetFlight]:
    for one in rows.drop_duplicates("flight").itertuples():
        yield FleetFlight(str(one.flight), str(one.vehicle), str(one.firmware), str(one.mission), str(one.date))


def _figure_names(rows: pd.DataFrame) -> tuple[FigureName, ...]:
    limited = rows.dropna(subset=["threshold"]).drop_duplicates(["id", "unit"])
    keys = zip(limited["id"], limited["unit"], strict=True)
    limit = dict(zip(keys, limited["threshold"].astype(float).tolist(), strict=True))
    return tuple(
        FigureName(str(one.id), str(one.group), str(one.unit), limit.get((one.id, one.unit)))
        for one in rows.drop_duplicates(["id", "unit"]).itertuples()
    )
