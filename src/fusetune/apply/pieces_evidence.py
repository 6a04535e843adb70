"""The evidence of a flight in some of its pieces: in turns alone, in hover alone, on one leg of a mission."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from fusetune.analyze.scoring.aims import AIDED, UNAIDED
from fusetune.apply.evidence import WITHOUT_SAMPLES, AimEvidence, AnalyzedFlight, FlightEvidence, NoEvidence
from fusetune.apply.settings import DecisionSettings
from fusetune.px4.aid_sources import AXES
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_table

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

    def of_classes(self, classes: Sequence[str]) -> Flags:
        """Rows of some manoeuvre classes."""
        return np.asarray(self.kind.places_in(classes) >= 0)

    def of_leg(self, leg: int) -> Flags:
        """Rows of a leg of the mission."""
        return np.asarray(self.leg == leg)


def read_flight_pieces(path: AnyPath) -> dict[str, PiecesOfFlight]:
    """Read the pieces of all flights, by the names of these.

    Raises
    ------
    UserError
        The file is missing or damaged.
    """
    table = read_table(path, _COLUMNS)
    flights = table["flight"].unique().to_pylist()
    return {name: _of_flight(table.filter(pc.equal(table["flight"], name))) for name in flights}


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
    times, time = np.unique(horizon, return_inverse=True)
    numbers = (source.codes.astype(np.int64) * len(AXES) + axis) * times.size + time
    kept, codes = np.unique(numbers, return_inverse=True)
    labels = []
    for number in kept.tolist():
        seconds = times[number % times.size]
        place, of_axis = divmod(number // times.size, len(AXES))
        labels.append(f"{source.words[place]} {AXES[of_axis]}" + (f" after {seconds:g} s" if seconds else ""))
    return Words(tuple(labels), codes)


def evidence_in(whole: FlightEvidence, pieces: PiecesOfFlight, rows: Flags) -> FlightEvidence | None:
    """What a flight says of the sets in some of its pieces.

    Aims, columns and weights are those of the whole flight, what is lacking in the pieces left out; the blocks, of
    which chance is judged where there is but one flight, are the pieces.

    Parameters
    ----------
    whole : evidence of the flight
    rows : (N,) of `pieces`

    Returns
    -------
    None where the pieces hold too little of every aim
    """
    aims = [found for aim in whole.aims if (found := _aim_in(aim, whole.sets, pieces, rows)) is not None]
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


def _aim_in(aim: AimEvidence, sets: Sequence[str], pieces: PiecesOfFlight, rows: Flags) -> AimEvidence | None:
    place, column = pieces.name.places_in(sets), pieces.label.places_in(aim.columns)
    rows = rows & (pieces.aim.places_in([aim.name]) == 0) & (column >= 0) & (place >= 0)
    if not rows.any():
        return None
    blocks, block = np.unique(pieces.piece[rows], return_inverse=True)
    index = (place[rows], block, column[rows])
    shape = (len(sets), blocks.size, len(aim.columns))
    n, nis, log_variance = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for sums, values in ((n, pieces.n), (nis, pieces.sum_nis), (log_variance, pieces.sum_log_variance)):
        np.add.at(sums, index, values[rows])
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
