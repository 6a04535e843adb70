"""The track of a flight as a file; where there is none it says why."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pyarrow as pa

from fusetune.analyze.conformance.flown_track import FlownTrack, TrackSource
from fusetune.errors import RUN_AGAIN, UserError
from fusetune.storage.files import AnyPath, atomic_path
from fusetune.storage.parquet import read_table, write_table

_SIGMAS = ("horizontal_sigma", "vertical_sigma")

TRACK_SCHEMA = pa.schema(
    [
        pa.field("time_us", pa.int64()),
        pa.field("lat", pa.float64()),
        pa.field("lon", pa.float64()),
        *(pa.field(name, pa.float32()) for name in ("height", "vn", "ve", "vd", "heading", *_SIGMAS)),
    ]
)
"""One row every 50 ms: degrees, m, NED m/s, rad; of `FlownTrack`. What holds for all rows stands in the metadata."""

_KEY = b"fusetune track"


def write_track(path: AnyPath, track: FlownTrack | None) -> None:
    """Write `results/analyze/<flight>/track.parquet`."""
    told: dict[str, Any] = {"source": None}
    table = TRACK_SCHEMA.empty_table()
    if track is not None:
        columns = {
            "time_us": track.time,
            "lat": track.lat,
            "lon": track.lon,
            "height": track.height,
            **dict(zip(("vn", "ve", "vd"), track.velocity.T, strict=True)),
            "heading": track.heading,
            **{name: getattr(track, name) for name in _SIGMAS},
        }
        arrays = [
            pa.array(np.asarray(columns[field.name]).astype(field.type.to_pandas_dtype())) for field in TRACK_SCHEMA
        ]
        table = pa.Table.from_arrays(arrays, schema=TRACK_SCHEMA)
        told = {
            "source": track.source,
            "is_above_takeoff": track.is_above_takeoff,
            "airborne": [list(one) for one in track.airborne],
        }
    with atomic_path(path) as temporary:
        write_table(table.replace_schema_metadata({_KEY: json.dumps(told).encode()}), temporary)


def read_track(path: AnyPath) -> FlownTrack | None:
    """Read it; None where the flight has no track.

    Raises
    ------
    UserError
        The file is missing or damaged, or holds no track.
    """
    table = read_table(path)
    metadata = table.schema.metadata or {}
    if _KEY not in metadata or not set(TRACK_SCHEMA.names) <= set(table.column_names):
        raise UserError(path, "holds no track of a flight", RUN_AGAIN)
    told = json.loads(metadata[_KEY])
    if told["source"] is None:
        return None
    column = {name: table[name].to_numpy() for name in TRACK_SCHEMA.names}
    wide = {name: column[name].astype(np.float64) for name in TRACK_SCHEMA.names[1:]}
    source: TrackSource = told["source"]
    return FlownTrack(
        source,
        column["time_us"],
        wide["lat"],
        wide["lon"],
        wide["height"],
        np.column_stack([wide[name] for name in ("vn", "ve", "vd")]),
        wide["heading"],
        wide["horizontal_sigma"],
        wide["vertical_sigma"],
        bool(told["is_above_takeoff"]),
        tuple((int(start), int(stop)) for start, stop in told["airborne"]),
    )
