"""A flight as a folder: one Parquet file per topic and instance, and `metadata.json` for all else."""

from __future__ import annotations

import base64
import math
import os
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from fusetune.errors import FOLDER_AGAIN, UserError
from fusetune.px4.flight import (
    Dropout,
    Flight,
    LeftOut,
    LoggedMessage,
    ParameterChange,
    ParameterHistory,
    ParameterValue,
    TopicTable,
)
from fusetune.storage.documents import read_document, write_document
from fusetune.storage.parquet import read_table, write_table
from fusetune.time_limit import Deadline

METADATA_FILE = "metadata.json"
_FORMAT = 2
_BYTES_KEY = "base64"


def write_flight(
    folder: str | os.PathLike[str],
    flight: Flight,
    extra: dict[str, Any] | None = None,
    deadline: Deadline | None = None,
) -> None:
    """Write a flight to a folder, which must exist.

    Parameters
    ----------
    extra
        Further entries of `metadata.json`.
    deadline
        By which it has to be done.

    Raises
    ------
    TimeLimitError
        It is not, by then; what was written stays.
    """
    target, deadline = Path(folder), deadline or Deadline()
    entries = []
    for (topic, instance), table in sorted(flight.topics.items()):
        deadline.check()
        file = f"{topic}_{instance}.parquet"
        _write_topic(target / file, table)
        entries.append({"topic": topic, "instance": instance, "rows": len(table["timestamp"]), "file": file})
    document = _metadata(flight) | (extra or {}) | {"topics": entries}
    write_document(target / METADATA_FILE, document, lines=True, allow_nan=False)


def load_flight(
    folder: str | os.PathLike[str], topics: Collection[str] | Mapping[str, Collection[str] | None] | None = None
) -> Flight:
    """Read a flight from its folder.

    Parameters
    ----------
    folder
        As written by `write_flight`.
    topics
        Names of the topics to read, all instances of each; `None` reads all. A mapping says of each, too, which columns
        beside `timestamp` are read, `None` for all. Names that the flight lacks are no error.

    Raises
    ------
    UserError
        The folder is not one of a saved flight, or a file in it is damaged.
    """
    source = Path(folder)
    document = read_metadata(source)
    wanted = [entry for entry in document["topics"] if topics is None or entry["topic"] in topics]
    columns = topics if isinstance(topics, Mapping) else {}
    tables = {
        (entry["topic"], entry["instance"]): _read_topic(source / entry["file"], columns.get(entry["topic"]))
        for entry in wanted
    }
    parameters = document["parameters"]
    return Flight(
        name=document["name"],
        topics=tables,
        parameters=ParameterHistory(
            initial=_values_of(parameters["initial"]),
            changed=[
                ParameterChange(change["timestamp"], change["name"], _value_of(change["value"]))
                for change in parameters["changed"]
            ],
            default_system=_values_of(parameters["default_system"]),
            default_current_setup=_values_of(parameters["default_current_setup"]),
        ),
        info={key: _info_of(value) for key, value in document["info"].items()},
        multi_info=document["multi_info"],
        dropouts=[Dropout(entry["timestamp"], entry["duration_ms"]) for entry in document["dropouts"]],
        messages=[LoggedMessage(entry["timestamp"], entry["level"], entry["text"]) for entry in document["messages"]],
        start_timestamp=document["start_timestamp"],
        last_timestamp=document["last_timestamp"],
        checksum=document["checksum"],
        size_bytes=document["size_bytes"],
        corruption=tuple(document["corruption"]),
        undefined_topics=tuple(document["undefined_topics"]),
        left_out=tuple(LeftOut(*entry) for entry in document["left_out"]),
        beyond_limits=tuple(document.get("beyond_limits", ())),
        release_signs=tuple(document.get("release_signs", ())),
    )


def read_metadata(folder: str | os.PathLike[str]) -> dict[str, Any]:
    """`metadata.json` of a saved flight.

    Raises
    ------
    UserError
        There is none, or it cannot be read.
    """
    file = Path(folder) / METADATA_FILE
    document = read_flight_document(file)
    if document.get("format") != _FORMAT or "topics" not in document:
        raise UserError(file, "is not the metadata of a readable flight", _remedy(file))
    return document


def read_flight_document(file: str | os.PathLike[str]) -> dict[str, Any]:
    """A JSON file of a saved flight.

    Raises
    ------
    UserError
        There is none, or it is damaged.
    """
    return read_document(file, remedy=_remedy(Path(file)))


def _remedy(file: Path) -> str:
    return FOLDER_AGAIN.format(folder=file.parent)


def _write_topic(file: Path, table: TopicTable) -> None:
    # hundreds of small files with thousands of short columns: what is done per file and column counts, not the bytes
    arrays = {name: pa.array(values) for name, values in table.items()}
    schema = pa.schema([pa.field(name, array.type, nullable=False) for name, array in arrays.items()])
    rows = pa.Table.from_arrays(list(arrays.values()), schema=schema)
    write_table(rows, file, compression="lz4", use_dictionary=False, write_statistics=False, store_schema=False)


def _read_topic(file: Path, columns: Collection[str] | None = None) -> TopicTable:
    chosen = None if columns is None else ["timestamp", *columns]
    table = read_table(file, chosen, remedy=_remedy(file))
    return {
        name: np.ascontiguousarray(column.to_numpy())
        for name, column in zip(table.column_names, table.columns, strict=True)
    }


def _metadata(flight: Flight) -> dict[str, Any]:
    history = flight.parameters
    return {
        "format": _FORMAT,
        "name": flight.name,
        "checksum": flight.checksum,
        "size_bytes": flight.size_bytes,
        "start_timestamp": flight.start_timestamp,
        "last_timestamp": flight.last_timestamp,
        "corruption": list(flight.corruption),
        "undefined_topics": list(flight.undefined_topics),
        "left_out": [list(entry) for entry in flight.left_out],
        "beyond_limits": list(flight.beyond_limits),
        "release_signs": list(flight.release_signs),
        "info": {key: _storable(value) for key, value in sorted(flight.info.items())},
        "multi_info": flight.multi_info,
        "parameters": {
            "initial": _storable_values(history.initial),
            "changed": [change._asdict() | {"value": _storable(change.value)} for change in history.changed],
            "default_system": _storable_values(history.default_system),
            "default_current_setup": _storable_values(history.default_current_setup),
        },
        "dropouts": [dropout._asdict() for dropout in flight.dropouts],
        "messages": [message._asdict() for message in flight.messages],
    }


def _storable_values(values: dict[str, ParameterValue]) -> dict[str, Any]:
    return {name: _storable(value) for name, value in values.items()}


def _storable(value: Any) -> Any:
    """A value as JSON has it: bytes in base64, numbers that JSON lacks as text."""
    if isinstance(value, bytes | bytearray):
        return {_BYTES_KEY: base64.b64encode(value).decode()}
    if isinstance(value, float) and not math.isfinite(value):
        return repr(value)
    if isinstance(value, str | int | float) or value is None:
        return value
    return str(value)


def _value_of(value: Any) -> ParameterValue:
    return float(value) if isinstance(value, str) else value


def _values_of(values: dict[str, Any]) -> dict[str, ParameterValue]:
    return {name: _value_of(value) for name, value in values.items()}


def _info_of(value: Any) -> object:
    return base64.b64decode(value[_BYTES_KEY]) if isinstance(value, dict) and _BYTES_KEY in value else value
