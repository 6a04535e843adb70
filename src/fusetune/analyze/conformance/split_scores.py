"""The scores of the sets split by manoeuvre class and leg: sums over the pieces of each flight, in one table.

They are sums of what `fusetune.analyze.scoring` scores: of a flight, all pieces together are its blocks together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.conformance.flight_pieces import NO_LEG, FlightPieces, flight_pieces
from fusetune.analyze.flight_files import CONFORMANCE_FILE, SAMPLES_FILE, SCORE_TABLES
from fusetune.analyze.metrics.likelihood import gaussian_nll, winsorised
from fusetune.analyze.scoring.aims import AIDED, SMOOTHED, UNAIDED
from fusetune.storage.documents import read_as
from fusetune.storage.files import AnyPath, atomic_path
from fusetune.storage.parquet import read_pieces, read_table, table_writer

Array = npt.NDArray[np.float64]

_SUMS = ("sum_squares", "sum_nis", "sum_log_variance", "sum_nll")

LEGS_SCHEMA = pa.schema(
    [
        *(pa.field(name, pa.dictionary(pa.int32(), pa.string())) for name in ("flight", "mission", "set", "class")),
        pa.field("piece", pa.int32()),
        pa.field("leg", pa.int32()),
        *(pa.field(name, pa.dictionary(pa.int32(), pa.string())) for name in ("aim", "source")),
        pa.field("axis", pa.int32()),
        pa.field("horizon_s", pa.float64()),
        pa.field("n", pa.int64()),
        *(pa.field(name, pa.float64()) for name in _SUMS),
    ]
)
"""One row per flight, set, piece of the flight, aim, source, axis and, without a sensor, seconds without it.

`leg` is empty beside all legs, `horizon_s` of other aims than `unaided`. `sum_squares` and `sum_nis` are of errors that
are clipped as the decision clips them; of what has no variance, the smoothed velocity, there is the first alone."""


def write_legs(analyze_folders: Sequence[AnyPath], output: AnyPath) -> None:
    """Write `results/analyze/legs.parquet` of all scored flights, one after the other.

    Parameters
    ----------
    analyze_folders : `results/analyze/<flight>`, each with its scores and `conformance.json`

    Raises
    ------
    UserError
        A file is missing or damaged.
    """
    with atomic_path(output) as temporary, table_writer(temporary, LEGS_SCHEMA) as writer:
        for folder in map(Path, analyze_folders):
            writer.write_table(split_scores(folder))


def split_scores(folder: AnyPath) -> pa.Table:
    """Rows of one flight."""
    folder = Path(folder)
    name, pieces = read_as(
        folder / CONFORMANCE_FILE, lambda one: (str(one["flight"]), flight_pieces(one)), "which mission a flight flew"
    )
    sums = _Sums()
    compared = {*_pairs(read_table(folder / SCORE_TABLES["blocks"], ("source", "axis")))}
    for table in read_pieces(folder / SAMPLES_FILE):
        _add_aided(sums, table, pieces, compared)
    _add_unaided(sums, read_table(folder / SCORE_TABLES["withheld"]), pieces)
    _add_smoothed(sums, read_table(folder / SCORE_TABLES["smoothed"]), pieces)
    return sums.table(name, pieces)


def _pairs(table: pa.Table) -> Iterator[tuple[str, int]]:
    yield from zip(table["source"].to_pylist(), table["axis"].to_pylist(), strict=True)


Key = tuple[str, str, str, int, float]
"""Set, aim, source, axis, horizon; NaN is no key, so 0 stands for none."""


class _Sums:
    """Sums over the pieces of a flight, by what is summed."""

    def __init__(self) -> None:
        self._of: dict[Key, dict[int, Array]] = {}

    def add(self, key: Key, piece: npt.NDArray[np.int64], count: npt.NDArray[Any], *values: Array) -> None:
        """Add values (N,) of rows in pieces (N,); those in none are left out."""
        found = self._of.setdefault(key, {})
        inside = piece >= 0
        for one in np.unique(piece[inside]).tolist():
            rows = piece == one
            sums = np.array([float(count[rows].sum()), *(float(value[rows].sum()) for value in values)])
            found[one] = found[one] + sums if one in found else sums

    def table(self, flight: str, pieces: FlightPieces) -> pa.Table:
        """In the order of sets, aims, sources, axes, horizons and pieces."""
        rows = [(key, piece, sums) for key in sorted(self._of) for piece, sums in sorted(self._of[key].items())]
        if not rows:
            return LEGS_SCHEMA.empty_table()
        keys, numbers, sums = zip(*rows, strict=True)
        columns: dict[str, Any] = {
            "flight": [flight] * len(rows),
            "mission": [pieces.mission] * len(rows),
            "set": [key[0] for key in keys],
            "class": [pieces.kind[one] for one in numbers],
            "piece": numbers,
            "leg": [None if pieces.leg[one] == NO_LEG else int(pieces.leg[one]) for one in numbers],
            "aim": [key[1] for key in keys],
            "source": [key[2] for key in keys],
            "axis": [key[3] for key in keys],
            "horizon_s": [key[4] if key[1] == UNAIDED else None for key in keys],
            "n": [int(one[0]) for one in sums],
            **{name: np.array([one[1 + place] for one in sums]) for place, name in enumerate(_SUMS)},
        }
        arrays = [pa.array(columns[field.name], type=_plain(field.type)) for field in LEGS_SCHEMA]
        return pa.Table.from_arrays(
            [one.dictionary_encode() if pa.types.is_string(one.type) else one for one in arrays], schema=LEGS_SCHEMA
        )


def _plain(kind: pa.DataType) -> pa.DataType:
    return kind.value_type if pa.types.is_dictionary(kind) else kind


def _groups(table: pa.Table, *names: str) -> Iterator[tuple[tuple[Any, ...], npt.NDArray[np.bool_]]]:
    """Values of some columns that stand together, and the rows (N,) that have them."""
    codes, values = [], []
    for name in names:
        column = table[name].combine_chunks()
        column = column if pa.types.is_dictionary(column.type) else column.dictionary_encode()
        codes.append(column.indices.to_numpy())
        values.append(column.dictionary.to_pylist())
    together = np.ravel_multi_index(codes, [len(one) for one in values]) if table.num_rows else np.zeros(0, int)
    for one in np.unique(together).tolist():
        places = np.unravel_index(one, [len(of) for of in values])
        yield tuple(of[place] for of, place in zip(values, places, strict=True)), together == one


def _add_aided(sums: _Sums, table: pa.Table, pieces: FlightPieces, compared: set[tuple[str, int]]) -> None:
    piece = pieces.at(table["time_us"].to_numpy())
    error, variance, limit = (
        table[name].to_numpy().astype(np.float64) for name in ("innovation", "innovation_variance", "winsor_limit")
    )
    for (name, source, axis), rows in _groups(table, "set", "source", "axis"):
        if (source, axis) in compared:
            key = (name, AIDED, source, int(axis), 0.0)
            clipped = winsorised(error[rows], float(limit[rows][0]))
            _add_errors(sums, key, piece[rows], error[rows], clipped, variance[rows])


def _add_unaided(sums: _Sums, table: pa.Table, pieces: FlightPieces) -> None:
    """A prediction belongs to the piece in which it is compared, its last second."""
    horizon = table["horizon_s"].to_numpy()
    piece = pieces.at(table["start_us"].to_numpy() + np.rint(1e6 * (horizon - 0.5)).astype(np.int64))
    error, clipped, variance = (table[name].to_numpy() for name in ("error", "error_winsorised", "variance"))
    for (name, source, axis, seconds), rows in _groups(table, "set", "source", "axis", "horizon_s"):
        key = (name, UNAIDED, source, int(axis), float(seconds))
        _add_errors(sums, key, piece[rows], error[rows], clipped[rows], variance[rows])


def _add_errors(
    sums: _Sums, key: Key, piece: npt.NDArray[np.int64], error: Array, clipped: Array, variance: Array
) -> None:
    squares = np.square(clipped)
    nll = gaussian_nll(error, variance)
    sums.add(key, piece, np.ones(error.size), squares, squares / variance, np.log(variance), nll)


def _add_smoothed(sums: _Sums, table: pa.Table, pieces: FlightPieces) -> None:
    """Sums of about a second belong to the piece of their middle."""
    piece = pieces.at((table["start_us"].to_numpy() + table["stop_us"].to_numpy()) // 2)
    count, squares = table["n"].to_numpy(), table["sum_squares_winsorised"].to_numpy()
    for (name, source, axis), rows in _groups(table, "set", "source", "axis"):
        nothing = np.full(np.count_nonzero(rows), np.nan)
        key = (name, SMOOTHED, source, int(axis), 0.0)
        sums.add(key, piece[rows], count[rows], squares[rows], nothing, nothing, nothing)
