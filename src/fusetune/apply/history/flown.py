"""Saved flights, as the history asks for them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from fusetune.apply.history.entries import history_file, read_history
from fusetune.apply.history.flights_after import FlownFlight, change_flown
from fusetune.px4.parameters.ekf2_parameters import BECAME, PARAMETERS
from fusetune.px4.vehicle_identity import VehicleIdentity
from fusetune.save.flight_folder import read_metadata
from fusetune.storage.files import AnyPath


def flown_flight(row: Mapping[str, Any], folder: AnyPath) -> FlownFlight:
    """A saved flight.

    Parameters
    ----------
    row : of `results/save/flights.parquet` or `.csv`
    folder : `results/save/<flight>`
    """
    metadata = read_metadata(folder)
    initial = metadata["parameters"]["initial"]
    read = {name for name in initial if name in PARAMETERS or name in BECAME}
    changes = metadata["parameters"]["changed"]
    return FlownFlight(
        row["flight"],
        metadata["checksum"],
        VehicleIdentity.from_row(row),
        row.get("recorded") or "",
        metadata["ekf2_parameters"],
        any(one["name"] in read and one["value"] != initial[one["name"]] for one in changes),
    )


def flights_of_changes(
    history_folder: AnyPath, rows: Iterable[Mapping[str, Any]], saved: AnyPath
) -> dict[str, dict[str, Any]]:
    """Of every replayable flight that flew a change of its vehicle's history: which, and the values before and after.

    Parameters
    ----------
    history_folder : `results/history`
    rows : of `results/save/flights.parquet` or `.csv`
    saved : `results/save`
    """
    found = {}
    for row in rows:
        if row["status"] != "replayable":
            continue
        history = read_history(history_file(history_folder, VehicleIdentity.from_row(row)))
        if not any(one.is_change for one in history.decisions):
            continue
        entry = change_flown(history.decisions, flown_flight(row, Path(saved) / row["flight"]))
        if entry is not None:
            before = {name: entry.before[name] for name in entry.changes}
            found[row["flight"]] = {"of": entry.key, "before": before, "after": dict(entry.changes)}
    return found
