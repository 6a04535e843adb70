"""The scores of the sets split by manoeuvre class and leg: sums over the pieces of each flight, in one table.

They are sums of what `fusetune.analyze.scoring` scores: of a flight, all pieces together are its blocks together.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from fusetune.analyze.conformance.flight_pieces import NO_LEG, FlightPieces, flight_pieces
from fusetune.analyze.conformance.piece_sums import Stretches
from fusetune.analyze.flight_files import CONFORMANCE_FILE, SAMPLES_FILE, SCORE_TABLES
from fusetune.analyze.metrics.likelihood import gaussian_nll, winsorised
from fusetune.analyze.scoring.aims import AIDED, SMOOTHED, UNAIDED
from fusetune.px4.aid_sources import AXES
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


def write_legs(analyze_folders: Sequence[AnyPath], output: AnyPath, threads: int = 1) -> None:
    """Write `results/analyze/legs.parquet` of all scored flights, one after the other.

    Parameters
    ----------
    analyze_folders : `results/analyze/<flight>`, each with its scores and `conformance.json`
    threads : flights that are read at a time

    Raises
    ------
    UserError
        A file is missing or damaged.
    """
    with (
        atomic_path(output) as temporary,
        table_writer(temporary, LEGS_SCHEMA) as writer,
        ThreadPoolExecutor(threads) as pool,
    ):
        for table in pool.map(split_scores, analyze_folders):
            writer.write_table(table)


def split_scores(folder: AnyPath) -> pa.Table:
    """Rows of one flight."""
    folder = Path(folder)
    name, pieces = read_as(
        folder / CONFORMANCE_FILE, lambda one: (str(one["flight"]), flight_pieces(one)), "which mission a flight flew"
    )
    compared = _pairs_in(read_table(folder / SCORE_TABLES["blocks"], ("source", "axis")))
    parts = [_aided(table, pieces, compared) for table in read_pieces(folder / SAMPLES_FILE, _SAMPLE_COLUMNS)]
    parts.append(_unaided(read_table(folder / SCORE_TABLES["withheld"], _WITHHELD_COLUMNS), pieces))
    parts.append(_smoothed(read_table(folder / SCORE_TABLES["smoothed"], _SMOOTHED_COLUMNS), pieces))
    return _together(parts, name, pieces)


_SAMPLE_COLUMNS = ("set", "source", "axis", "time_us", "innovation", "innovation_variance", "winsor_limit")
_WITHHELD_COLUMNS = (
    "set", "source", "axis", "horizon_s", "start_us", "error", "error_winsorised", "variance",
)  # fmt: skip
_SMOOTHED_COLUMNS = ("set", "source", "axis", "start_us", "stop_us", "n", "sum_squares_winsorised")


@dataclass(frozen=True)
class _Part:
    """Sums over the pieces of a flight, R rows: keys as columns, with none of a horizon 0."""

    set: pa.DictionaryArray
    aim: str
    source: pa.DictionaryArray
    axis: npt.NDArray[np.int64]
    horizon: Array
    piece: npt.NDArray[np.int64]
    n: npt.NDArray[Any]
    sums: tuple[Array, ...]


def _part(
    aim: str, table: pa.Table, rows: Stretches, piece: npt.NDArray[np.int64], n: npt.NDArray[Any], *sums: Array
) -> _Part:
    first = rows.first
    horizon = table["horizon_s"].to_numpy()[first] if aim == UNAIDED else np.zeros(first.size)
    return _Part(
        _coded(table["set"]).take(pa.array(first)),
        aim,
        _coded(table["source"]).take(pa.array(first)),
        table["axis"].to_numpy()[first].astype(np.int64),
        horizon,
        piece[first],
        n,
        sums,
    )


def _coded(column: pa.ChunkedArray) -> pa.DictionaryArray:
    one = column.combine_chunks()
    return one if pa.types.is_dictionary(one.type) else one.dictionary_encode()


def _codes(column: pa.ChunkedArray) -> npt.NDArray[np.int32]:
    return np.asarray(_coded(column).indices.to_numpy())


def _pairs_in(table: pa.Table) -> set[tuple[str, int]]:
    """Sources and axes of a table."""
    return {(one["source"], one["axis"]) for one in table.group_by(["source", "axis"]).aggregate([]).to_pylist()}


def _aided(table: pa.Table, pieces: FlightPieces, compared: set[tuple[str, int]]) -> _Part:
    source, axis = _coded(table["source"]), table["axis"].to_numpy()
    pairs = [(name, one) in compared for name in source.dictionary.to_pylist() for one in range(len(AXES))]
    is_compared = np.array(pairs, bool).reshape(-1, len(AXES))
    piece = pieces.at_ascending(table["time_us"].to_numpy())
    code = source.indices.to_numpy()
    rows = Stretches.of(_codes(table["set"]), code, axis, piece)
    first = rows.first
    rows = rows.only((piece[first] >= 0) & is_compared[code[first], axis[first]])
    error = rows.laid_out(table["innovation"].to_numpy(), 0.0)
    variance = rows.laid_out(table["innovation_variance"].to_numpy(), 1.0)
    limit = rows.each(table["winsor_limit"].to_numpy()[rows.first])
    sums = _error_sums(rows, error, winsorised(error, limit), variance)
    return _part(AIDED, table, rows, piece, rows.count, *sums)


def _unaided(table: pa.Table, pieces: FlightPieces) -> _Part:
    """A prediction belongs to the piece in which it is compared, its last second."""
    horizon = table["horizon_s"].to_numpy()
    piece = pieces.at(table["start_us"].to_numpy() + np.rint(1e6 * (horizon - 0.5)).astype(np.int64))
    rows = _in_pieces(piece, *_key(table), _ranks(horizon))
    error, clipped = (rows.laid_out(table[name].to_numpy(), 0.0) for name in ("error", "error_winsorised"))
    variance = rows.laid_out(table["variance"].to_numpy(), 1.0)
    return _part(UNAIDED, table, rows, piece, rows.count, *_error_sums(rows, error, clipped, variance))


def _in_pieces(piece: npt.NDArray[np.int64], *codes: npt.NDArray[np.integer]) -> Stretches:
    rows = Stretches.of(*codes, piece)
    return rows.only(piece[rows.first] >= 0)


def _ranks(values: Array) -> npt.NDArray[np.intp]:
    return np.unique(values, return_inverse=True)[1]


def _key(table: pa.Table) -> tuple[npt.NDArray[np.integer], ...]:
    return _codes(table["set"]), _codes(table["source"]), table["axis"].to_numpy()


def _error_sums(rows: Stretches, error: Array, clipped: Array, variance: Array) -> tuple[Array, ...]:
    squares = np.square(clipped)
    return (
        rows.sums(squares),
        rows.sums(squares / variance),
        rows.sums(np.log(variance)),
        rows.sums(gaussian_nll(error, variance)),
    )


def _smoothed(table: pa.Table, pieces: FlightPieces) -> _Part:
    """Sums of about a second belong to the piece of their middle."""
    piece = pieces.at((table["start_us"].to_numpy() + table["stop_us"].to_numpy()) // 2)
    rows = _in_pieces(piece, *_key(table))
    count, squares = (rows.sums(rows.laid_out(table[name].to_numpy(), 0.0)) for name in ("n", "sum_squares_winsorised"))
    nothing = np.full(squares.size, np.nan)
    return _part(SMOOTHED, table, rows, piece, count, squares, nothing, nothing, nothing)


def _together(parts: Sequence[_Part], flight: str, pieces: FlightPieces) -> pa.Table:
    """In the order of sets, aims, sources, axes, horizons and pieces; a set that lies in two parts is added up."""
    set_names, of_set = _by_name([one.set for one in parts])
    source_names, source = _by_name([one.source for one in parts])
    aim_names, aim = _by_name([pa.array([one.aim] * one.n.size, pa.string()).dictionary_encode() for one in parts])
    axis, piece = (np.concatenate(values) for values in ([one.axis for one in parts], [one.piece for one in parts]))
    horizon = np.concatenate([one.horizon for one in parts])
    if not piece.size:
        return LEGS_SCHEMA.empty_table()
    rows = Stretches.sorted(of_set, aim, source, axis, _ranks(horizon), piece)
    first, row = rows.first, np.repeat(np.arange(rows.count.size), rows.count)
    columns_of_parts = ([one.n for one in parts], *([one.sums[place] for one in parts] for place in range(len(_SUMS))))
    n, *sums = (np.bincount(row, np.concatenate(values)[rows.order]) for values in columns_of_parts)
    piece, horizon = piece[first], horizon[first]
    is_unaided = np.array([one == UNAIDED for one in aim_names])[aim[first]]
    kinds = tuple(dict.fromkeys(pieces.kind))
    leg = pieces.leg[piece]
    columns: dict[str, pa.Array] = {
        "flight": _words(np.zeros(first.size, np.int64), (flight,)),
        "mission": _words(np.zeros(first.size, np.int64), (pieces.mission,)),
        "set": _words(of_set[first], set_names),
        "class": _words(np.array([kinds.index(one) for one in pieces.kind])[piece], kinds),
        "piece": pa.array(piece.astype(np.int32)),
        "leg": pa.array(leg.astype(np.int32), mask=leg == NO_LEG),
        "aim": _words(aim[first], aim_names),
        "source": _words(source[first], source_names),
        "axis": pa.array(axis[first].astype(np.int32)),
        "horizon_s": pa.array(horizon, mask=~is_unaided),
        "n": pa.array(n.astype(np.int64)),
        **{name: pa.array(values) for name, values in zip(_SUMS, sums, strict=True)},
    }
    return pa.Table.from_arrays([columns[field.name] for field in LEGS_SCHEMA], schema=LEGS_SCHEMA)


def _by_name(parts: Sequence[pa.DictionaryArray]) -> tuple[tuple[str, ...], npt.NDArray[np.int64]]:
    """Names in their order, and of each row of the parts, one after the other, the place of its name among them."""
    names = tuple(sorted({name for one in parts for name in one.dictionary.to_pylist()}))
    place = {name: number for number, name in enumerate(names)}
    codes = [
        np.array([place[name] for name in one.dictionary.to_pylist()], np.int64)[one.indices.to_numpy()]
        for one in parts
    ]
    return names, np.concatenate(codes)


def _words(codes: npt.NDArray[np.int64], words: Sequence[str]) -> pa.DictionaryArray:
    """A column of words, in the order in which they first stand in it."""
    first = np.full(len(words), codes.size)
    np.minimum.at(first, codes, np.arange(codes.size))
    order = np.argsort(first, kind="stable")[: np.count_nonzero(first < codes.size)]
    place = np.zeros(len(words), np.int32)
    place[order] = np.arange(order.size)
    return pa.DictionaryArray.from_arrays(pa.array(place[codes]), pa.array([words[one] for one in order], pa.string()))
