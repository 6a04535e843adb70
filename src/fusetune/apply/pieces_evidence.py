"""The evidence of a flight in some of its pieces: in turns alone, in hover alone, on one leg of a mission."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from fusetune.analyze.scoring.aims import AIDED, UNAIDED
from fusetune.apply.evidence import WITHOUT_SAMPLES, AimEvidence, AnalyzedFlight, FlightEvidence, NoEvidence
from fusetune.apply.settings import DecisionSettings
from fusetune.px4.aid_sources import AXES
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_pieces

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

FEWEST = {AIDED: 30, UNAIDED: 3}
"""A column of which the pieces hold fewer samples, or gaps, says nothing there; of the smoothed velocity as of the
first."""
_COLUMNS = ("flight", "mission", "set", "class", "piece", "leg", "aim", "source", "axis", "horizon_s", "n",
            "sum_squares", "sum_nis", "sum_log_variance")  # fmt: skip


@dataclass(frozen=True)
class Words:
    """A column of few different words; `codes` (N,) are their places in `words`."""

    words: tuple[str, ...]
    codes: npt.NDArray[np.integer]

    @classmethod
    def of(cls, column: Sequence[str]) -> Words:
        """A column as it is written."""
        words, codes = np.unique(np.array(column, dtype=str), return_inverse=True)
        return cls(tuple(words.tolist()), codes)

    def places_in(self, order: Sequence[str]) -> npt.NDArray[np.int64]:
        """(N,) the place of each row's word in a sequence of words, −1 where it is none of them."""
        places = {word: place for place, word in enumerate(order)}
        return np.array([places.get(word, -1) for word in self.words], np.int64)[self.codes]


@dataclass(frozen=True)
class PiecesOfFlight:
    """Rows of `results/analyze/legs.parquet` of one flight, as arrays (N,).

    Attributes
    ----------
    mission : that it flew; empty where it flew none
    label : of the column in `AimEvidence.columns`
    leg : −1 beside all legs
    """

    mission: str
    name: Words
    kind: Words
    piece: npt.NDArray[np.int64]
    leg: npt.NDArray[np.int64]
    aim: Words
    label: Words
    n: Array
    sum_nis: Array
    sum_log_variance: Array
    _by_piece: dict[tuple[str, tuple[str, ...], tuple[str, ...]], PieceSums] = field(default_factory=dict, repr=False)

    @property
    def legs(self) -> list[int]:
        """Legs that it flew, ascending."""
        return np.unique(self._leg_of_piece[self._leg_of_piece >= 0]).tolist()

    def of_classes(self, classes: Sequence[str]) -> Flags:
        """(P,) pieces that are of some manoeuvre classes."""
        wanted = [number for number, word in enumerate(self.kind.words) if word in classes]
        return np.isin(self.kind.codes[self._pieces[0]], wanted)

    def of_leg(self, leg: int) -> Flags:
        """(P,) pieces that are of a leg of the mission."""
        return np.asarray(self._leg_of_piece == leg)

    @cached_property
    def _leg_of_piece(self) -> npt.NDArray[np.int64]:
        return self.leg[self._pieces[0]]

    @cached_property
    def _pieces(self) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """(P,) a row of each piece, in their order, and (N,) the place of each row's piece among them."""
        pieces, place = _few(self.piece)
        first = np.zeros(pieces.size, np.intp)
        first[place[::-1]] = np.arange(place.size)[::-1]
        return first, place

    def sums(self, aim: AimEvidence, sets: tuple[str, ...]) -> PieceSums:
        """All pieces of an aim of the flight; what single classes and legs say is asked for again and again."""
        key = (aim.name, sets, aim.columns)
        if key not in self._by_piece:
            self._by_piece[key] = self._sums(aim, sets)
        return self._by_piece[key]

    def _sums(self, aim: AimEvidence, sets: tuple[str, ...]) -> PieceSums:
        first, piece = self._pieces
        place, column = self.name.places_in(sets), self.label.places_in(aim.columns)
        rows = np.flatnonzero((self.aim.places_in([aim.name]) == 0) & (column >= 0) & (place >= 0))
        shape = (len(sets), first.size, len(aim.columns))
        cell = np.ravel_multi_index((place[rows], piece[rows], column[rows]), shape)

        def summed(values: Array) -> Array:
            return np.bincount(cell, values[rows], math.prod(shape)).astype(np.float64, copy=False).reshape(shape)

        known = np.bincount(piece[rows], minlength=first.size) > 0
        return PieceSums(known, summed(self.n), summed(self.sum_nis), summed(self.sum_log_variance))


@dataclass(frozen=True)
class PieceSums:
    """Sums of S sets over P pieces of a flight, of the A columns of an aim.

    Attributes
    ----------
    known : (P,) pieces of which there is any
    n, sum_nis, sum_log_variance : (S, P, A) as in `AimEvidence`
    """

    known: Flags
    n: Array
    sum_nis: Array
    sum_log_variance: Array


def read_flight_pieces(path: AnyPath) -> dict[str, PiecesOfFlight]:
    """Read the pieces of all flights, by the names of these.

    Raises
    ------
    UserError
        The file is missing or damaged.
    """
    found: dict[str, list[pa.Table]] = {}
    for table in read_pieces(path, _COLUMNS):
        flights = table["flight"].unique().to_pylist()
        for name in flights:
            own = table if len(flights) == 1 else table.filter(pc.equal(table["flight"], name))
            found.setdefault(name, []).append(own)
    return {name: _of_flight(pa.concat_tables(found.pop(name)).unify_dictionaries()) for name in list(found)}


def _of_flight(table: pa.Table) -> PiecesOfFlight:
    name, kind, aim, source = (_words(table[column]) for column in ("set", "class", "aim", "source"))
    horizon = np.nan_to_num(pc.fill_null(table["horizon_s"], np.nan).to_numpy())
    is_aided = aim.places_in([AIDED]) == 0
    # of an error without the sensor, and of the smoothed velocity, the error alone counts, as in the whole decision
    nis = np.where(is_aided, table["sum_nis"].to_numpy(), table["sum_squares"].to_numpy())
    log_variance = np.where(is_aided, table["sum_log_variance"].to_numpy(), 0.0)
    return PiecesOfFlight(
        str(table["mission"][0].as_py()),
        name,
        kind,
        table["piece"].to_numpy().astype(np.int64),
        pc.fill_null(table["leg"], -1).to_numpy().astype(np.int64),
        aim,
        _labels(source, table["axis"].to_numpy(), horizon),
        table["n"].to_numpy().astype(np.float64),
        nis,
        log_variance,
    )


def _words(column: pa.ChunkedArray) -> Words:
    one = column.combine_chunks()
    return Words(tuple(one.dictionary.to_pylist()), one.indices.to_numpy())


def _labels(source: Words, axis: npt.NDArray[np.integer], horizon: Array) -> Words:
    """What a row is of, 0 s standing for no horizon, as `AimEvidence.columns` has it."""
    times = np.unique(horizon)
    numbers = (source.codes.astype(np.int64) * len(AXES) + axis) * times.size + np.searchsorted(times, horizon)
    kept, codes = _few(numbers)
    labels = []
    for number in kept.tolist():
        seconds = times[number % times.size]
        place, of_axis = divmod(number // times.size, len(AXES))
        labels.append(f"{source.words[place]} {AXES[of_axis]}" + (f" after {seconds:g} s" if seconds else ""))
    return Words(tuple(labels), codes)


def _few(numbers: npt.NDArray[np.int64]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Different numbers from 0 on, of which the largest is small, and (N,) the place of each row's among them."""
    is_there = np.bincount(numbers) > 0
    return np.flatnonzero(is_there), (np.cumsum(is_there) - 1)[numbers]


def evidence_in(whole: FlightEvidence, pieces: PiecesOfFlight, wanted: Flags) -> FlightEvidence | None:
    """What a flight says of the sets in some of its pieces.

    Aims, columns and weights are those of the whole flight, what is lacking in the pieces left out; the blocks, of
    which chance is judged where there is but one flight, are the pieces.

    Parameters
    ----------
    whole : evidence of the flight
    wanted : (P,) which of them, as `PiecesOfFlight.of_classes` and `of_leg` say

    Returns
    -------
    None where the pieces hold too little of every aim
    """
    aims = [found for aim in whole.aims if (found := _aim_in(aim, pieces.sums(aim, whole.sets), wanted)) is not None]
    total = sum(aim.weight for aim in aims)
    if total <= 0.0:
        return None
    able = np.all([np.isfinite(aim.scores) for aim in aims], axis=0)
    named = tuple(name for name, one in zip(whole.sets, able, strict=True) if one)
    weighed = [
        replace(aim, weight=aim.weight / total, sum_nis=aim.sum_nis[able], sum_log_variance=aim.sum_log_variance[able])
        for aim in aims
    ]
    return FlightEvidence(whole.flight, named, tuple(weighed)) if named else None


def in_classes(
    flight: AnalyzedFlight, pieces: Mapping[str, PiecesOfFlight], present: str, settings: DecisionSettings
) -> AnalyzedFlight:
    """A flight whose evidence is that of the classes that alone count; all else of it stays."""
    if flight.evidence is None:
        return flight
    own = pieces.get(flight.name)
    found = None if own is None else evidence_in(flight.evidence, own, own.of_classes(settings.only_classes))
    if found is not None and present in found.sets:
        return replace(flight, evidence=found)
    reason = f"the flight holds too little of {', '.join(settings.only_classes)} to judge by"
    return replace(flight, evidence=None, without=NoEvidence(WITHOUT_SAMPLES, reason))


def _aim_in(aim: AimEvidence, sums: PieceSums, wanted: Flags) -> AimEvidence | None:
    blocks = wanted & sums.known
    if not blocks.any():
        return None
    n, nis, log_variance = (one[:, blocks] for one in (sums.n, sums.sum_nis, sums.sum_log_variance))
    enough = n[0].sum(axis=0) >= FEWEST.get(aim.name, FEWEST[AIDED])
    weights = aim.column_weights * enough
    if not weights.any():
        return None
    return AimEvidence(
        aim.name,
        aim.weight,
        tuple(label for label, one in zip(aim.columns, enough, strict=True) if one),
        weights[enough] / weights.sum(),
        n[0][:, enough],
        nis[:, :, enough],
        log_variance[:, :, enough],
    )
