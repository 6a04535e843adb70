"""The health table in files: a document per flight, and one table of all flights."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import pyarrow as pa

from fusetune.analyze.health.health_row import HealthRow
from fusetune.analyze.health.health_table import DEFAULTS, HEALTH_TOPICS, health_rows
from fusetune.analyze.health.settings import HealthSettings
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.analyze.replaying.settings import IN_USE, ReplaySettings
from fusetune.px4.flight import Flight
from fusetune.px4.vehicle_identity import vehicle_identity
from fusetune.save.flight_folder import load_flight
from fusetune.save.log_facts import recorded_at
from fusetune.save.replayed_release import replayed_release
from fusetune.storage.documents import read_as, write_document
from fusetune.storage.files import AnyPath, atomic_path
from fusetune.storage.parquet import write_table

SCHEMA = pa.schema(
    [
        *((name, pa.string()) for name in ("flight", "vehicle", "firmware", "date", "mission", "id", "group")),
        ("instance", pa.int32()),
        ("origin", pa.string()),
        ("severity", pa.string()),
        ("figure", pa.float64()),
        ("threshold", pa.float64()),
        ("unit", pa.string()),
        ("start_s", pa.float64()),
        ("stop_s", pa.float64()),
    ]
)
"""One line per figure of a flight; times are seconds from the start of its log, `instance` is empty where there is
but one or none, figure and threshold where there is none."""

_OF_FLIGHT = ("flight", "vehicle", "firmware", "date", "mission")
_OF_ROW = ("id", "group", "instance", "origin", "severity", "figure", "threshold", "unit")


def health_document(
    logged: Flight, rows: Iterable[HealthRow], mission: str = "", replay: ReplaySettings = IN_USE
) -> dict[str, Any]:
    """The table of a flight as JSON holds it: what the flight is, and its rows as findings, times in µs since boot."""
    replayed = replayed_release(logged, replay.release)
    return {
        "flight": logged.name,
        "vehicle": vehicle_identity(logged).name,
        "firmware": logged.release_name,
        "replayed_as": replayed.name,
        "replayed_why": replayed.reason,
        "date": recorded_at(logged),
        "mission": mission,
        "start_us": int(logged.start_timestamp),
        "rows": [row.document() for row in rows],
    }


def tidy_rows(document: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Lines of the table of all flights, from the document of one."""
    flight = {name: document[name] for name in _OF_FLIGHT}
    start = document["start_us"]
    for row in document["rows"]:
        times = {
            f"{edge}_s": None if row[f"{edge}_us"] is None else (row[f"{edge}_us"] - start) * 1e-6
            for edge in ("start", "stop")
        }
        yield flight | {name: row[name] for name in _OF_ROW} | times


def write_health(
    flight_folder: AnyPath,
    output_file: AnyPath,
    settings: HealthSettings = DEFAULTS,
    replay: ReplaySettings = IN_USE,
    mission: str = "",
) -> None:
    """Write the health table of a saved flight as a JSON file.

    Parameters
    ----------
    flight_folder : `results/save/<flight>`
    output_file : `results/analyze/<flight>/health.json`
    replay : how it is replayed, where its log lacks what its own estimator did
    mission : what was flown, where it is known

    Raises
    ------
    UserError
        The saved flight is missing or damaged.
    """
    logged = load_flight(flight_folder, topics=HEALTH_TOPICS)
    document = health_document(logged, health_rows(ObservedFlight(logged, replay), settings), mission, replay)
    with atomic_path(output_file) as temporary:
        write_document(temporary, document)


def write_health_table(files: Sequence[AnyPath], output: AnyPath) -> None:
    """Put the health of many flights into one Parquet table with the columns of `SCHEMA`, in the order given.

    Raises
    ------
    UserError
        A file is missing or damaged, or holds no health of a flight.
    """
    rows = [
        row for file in files for row in read_as(file, lambda found: list(tidy_rows(found)), "the health of a flight")
    ]
    with atomic_path(output) as temporary:
        write_table(pa.Table.from_pylist(rows, schema=SCHEMA), temporary)
