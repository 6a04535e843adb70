"""Fleets made for tests: a table of health, in memory or as the file that the pipeline writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.health.health_files import SCHEMA
from fusetune.apply.fleet.flights import SEVERITIES, FigureName, FleetFlight, FleetTable
from fusetune.storage.parquet import write_table

VEHICLE = "PX4_FMU_V5-001122334455-4001"


def made_table(
    values: npt.ArrayLike, *, firmware: Sequence[str] = (), dated: bool = True, limit: float | None = None
) -> FleetTable:
    """Flights of one vehicle, one a day; values (F, K), all of them passed."""
    values = np.asarray(values, dtype=np.float64)
    flights = tuple(
        FleetFlight(f"flight_{row}", VEHICLE, firmware[row] if firmware else "v1.16.0", "", date(row) if dated else "")
        for row in range(len(values))
    )
    figures = tuple(
        FigureName(f"gnss.figure_{column}", "GNSS quality", "m", limit) for column in range(values.shape[1])
    )
    passed = np.full(values.shape, SEVERITIES.index("pass"), dtype=np.int8)
    return FleetTable(flights, figures, values, passed)


def date(day: int) -> str:
    """ISO 8601, counted from 2026-01-01."""
    return (np.datetime64("2026-01-01T10:00:00") + np.timedelta64(day, "D")).astype(str) + "Z"


def row(flight: str, figure: str, value: float | None, **told: Any) -> dict[str, Any]:
    """A line of the health table; `told` is what differs from a figure that passed."""
    line = {
        "flight": flight,
        "vehicle": VEHICLE,
        "firmware": "v1.16.0",
        "date": date(0),
        "mission": "",
        "id": figure,
        "group": "GNSS quality",
        "instance": None,
        "origin": "vehicle",
        "severity": "pass",
        "figure": value,
        "threshold": None,
        "unit": "m",
        "start_s": None,
        "stop_s": None,
    }
    return line | told


def write_health_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    """The file as the analysis writes it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_table(pa.Table.from_pylist(list(rows), schema=SCHEMA), path)
    return path


def found(cause: str, severity: str = "warning", confidence: float = 0.9, **told: Any) -> dict[str, Any]:
    """A diagnosis as its document tells it."""
    document = {
        "id": cause,
        "cause": f"It is {cause}",
        "severity": severity,
        "confidence": confidence,
        "since_s": 12.0,
        "until_s": 30.0,
        "evidence": [],
        "remedy": f"Mend the {cause}",
        "values": {},
        "source": "PX4's guide",
    }
    return document | told


def made_diagnosis(
    flight: str, diagnoses: Sequence[dict[str, Any]], refused: str = "", *, readable: bool = True
) -> dict[str, Any]:
    """A document `diagnosis.json`; `refused` is why the flight is not replayed."""
    reasons = [{"found": refused, "remedy": "Log the flight again"}] if refused else []
    return {"flight": flight, "diagnoses": list(diagnoses), "readable": readable, "refused": reasons, "not_told": {}}
