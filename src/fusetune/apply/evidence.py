"""The evidence of each flight: block sums of the errors that every parameter set made on the same measurements.

What sets are judged by are the aims. *Aided*: predictions one step ahead, all sensors in use. *Unaided*: seconds
ahead, without GNSS. *Smoothed*: the velocity against one that is smoothed from before and after. Each has columns
(source, axis and, unaided, horizon), and each column a scale-profiled NLL.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from fusetune.analyze.metrics.likelihood import profile_nll
from fusetune.analyze.scoring.aims import AIDED, AIMS, SMOOTHED, UNAIDED
from fusetune.analyze.scoring.metrics_schema import METRICS_SCHEMA
from fusetune.analyze.trust.settings import reaches
from fusetune.apply.settings import DecisionSettings
from fusetune.px4.aid_sources import AXES
from fusetune.set_names import DELAY_MENDED
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_pieces, read_table
from fusetune.storage.words import places

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class AimEvidence:
    """Block sums of one kind of prediction on one flight.

    Attributes
    ----------
    name : one of `AIMS`
    weight : of this aim in the flight's score
    columns : (A,) what each column is, e.g. "gnss_vel x" or "gnss_vel x after 9 s"
    column_weights : (A,) sum to 1
    n : (B, A) samples per block and column, the same for all sets
    sum_nis, sum_log_variance : (S, B, A) sums of ν²/S, winsorised alike for all sets, and ln S
    """

    name: str
    weight: float
    columns: tuple[str, ...]
    column_weights: Array
    n: Array
    sum_nis: Array
    sum_log_variance: Array

    @cached_property
    def column_scores(self) -> Array:
        """(S, A) scale-profiled NLL of every column, nat."""
        n = self.n.sum(axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            return profile_nll(self.sum_nis.sum(axis=1) / n, self.sum_log_variance.sum(axis=1) / n)

    @cached_property
    def scores(self) -> Array:
        """(S,) weighted mean over the columns."""
        return np.asarray(self.column_scores @ self.column_weights)


@dataclass(frozen=True)
class FlightEvidence:
    """What one flight says about the sets that were scored on it; the weights of its aims sum to 1."""

    flight: str
    sets: tuple[str, ...]
    aims: tuple[AimEvidence, ...]

    @cached_property
    def scores(self) -> Array:
        """(S,) score of the flight: the logarithm of a typical prediction error, nat; lower is better."""
        return np.asarray(sum(aim.weight * aim.scores for aim in self.aims))

    def differences(self, names: Sequence[str], aim: str | None = None) -> Array:
        """(N,) scores of some sets less that of the first of them; in one of its aims, which it then must have."""
        part = self if aim is None else self.aim(aim)
        assert part is not None, "only flights that have the aim are asked for it"
        scores = part.scores[self.rows_of(names)]
        return np.asarray(scores - scores[0])

    @cached_property
    def row(self) -> Mapping[str, int]:
        """Set → its row."""
        return {name: row for row, name in enumerate(self.sets)}

    def rows_of(self, names: Sequence[str]) -> npt.NDArray[np.int64]:
        """(N,) rows of some sets."""
        return np.array([self.row[name] for name in names], np.int64)

    def aim(self, name: str) -> AimEvidence | None:
        """One of the aims, None where this flight has no evidence of it or gives it no weight."""
        return next((aim for aim in self.aims if aim.name == name), None)


NOT_SCORED, DISTRUSTED, WITHOUT_SAMPLES = "not scored", "distrusted", "without samples"
MISLEADING = "misleading"
OTHER_VEHICLE = "other vehicle"
"""Why a flight has no evidence: it could not be scored, its replay is not trusted, nothing in it is judged by, what is
there would mislead, or another vehicle is decided for."""


@dataclass(frozen=True)
class NoEvidence:
    """Why a flight has no evidence.

    Attributes
    ----------
    kind : `NOT_SCORED`, `DISTRUSTED`, `WITHOUT_SAMPLES`, `MISLEADING` or `OTHER_VEHICLE`
    reason : in words
    """

    kind: str
    reason: str


@dataclass(frozen=True)
class AnalyzedFlight:
    """What the analyze room says about one flight: its summary, and the evidence or why there is none.

    `metrics` are those of its figures that decisions look at (`DECISIVE_METRICS`), columns of `METRICS_SCHEMA` with
    words as dictionaries; none of a flight that is left out.
    """

    name: str
    folder: Path
    summary: dict[str, Any]
    metrics: pa.Table
    evidence: FlightEvidence | None
    without: NoEvidence | None = None

    @property
    def reason(self) -> str:
        """Why there is no evidence, in words; empty where there is."""
        return self.without.reason if self.without else ""


DECISIVE_METRICS = (
    "rmse", "rms_innovation", "mean_nis", "j_nis", "c_nis", "nll", "break_rate_gate", "lag1_correlation",
    "white_share", "white_noise", "correlated_noise", "error_correlation_s", "equivalent_noise", "told_noise",
)  # fmt: skip
"""A small part of the figures of a flight; of a thousand sets all of them would take a gigabyte for ten flights."""


@dataclass(frozen=True)
class BlockSums:
    """Block sums of one aim before the sets of all aims are brought together; axes as in `AimEvidence`."""

    sets: tuple[str, ...]
    columns: tuple[tuple[str, str], ...]
    n: Array
    sum_nis: Array
    sum_log_variance: Array


def read_flights(
    folders: Sequence[AnyPath], settings: DecisionSettings, present: str, seen_by: str = DELAY_MENDED
) -> list[AnalyzedFlight]:
    """Read `results/analyze/<flight>` of all flights of a vehicle, ordered by name so that the order of arguments does
    not matter.

    A flight that is too short to show how white a source is takes the mean of those that do, as all are of one vehicle.

    Parameters
    ----------
    seen_by : the set that says how white the sources are, where a flight has it; the present one elsewhere. A source
        with a wrong delay looks coloured, as its error holds the acceleration.
    """
    metrics = {folder: _read_metrics(folder) for folder in map(Path, folders)}
    shares = {one: white_shares(table, seen_by) or white_shares(table, present) for one, table in metrics.items()}
    known: dict[str, list[float]] = {}
    for one in shares.values():
        for source, share in one.items():
            known.setdefault(source, []).append(share)
    usual = {source: float(np.mean(sorted(found))) for source, found in known.items()}
    flights = (_read_flight(one, table, settings, present, usual | shares[one]) for one, table in metrics.items())
    return sorted(flights, key=lambda one: one.name)


def read_left_out(folder: AnyPath, without: NoEvidence) -> AnalyzedFlight:
    """Read `results/analyze/<flight>` of a flight that is left out, whatever it holds."""
    folder = Path(folder)
    summary = read_document(folder / "scoring.json")
    return AnalyzedFlight(
        summary["flight"], folder, summary, METRICS_SCHEMA.empty_table(), evidence=None, without=without
    )


def _read_metrics(folder: Path) -> pa.Table:
    words = [field.name for field in METRICS_SCHEMA if pa.types.is_string(field.type)]
    decisive = pa.array(DECISIVE_METRICS)
    pieces = read_pieces(folder / "metrics.parquet", words=words)
    return pa.concat_tables([one.filter(pc.is_in(one["metric"], value_set=decisive)) for one in pieces])


def _read_flight(
    folder: Path, metrics: pa.Table, settings: DecisionSettings, present: str, whiteness: Mapping[str, float]
) -> AnalyzedFlight:
    summary = read_document(folder / "scoring.json")
    found = _evidence_of(folder, summary, settings, present, whiteness)
    evidence, without = (None, found) if isinstance(found, NoEvidence) else (found, None)
    return AnalyzedFlight(summary["flight"], folder, summary, metrics, evidence, without)


def _evidence_of(
    folder: Path,
    summary: Mapping[str, Any],
    settings: DecisionSettings,
    present: str,
    whiteness: Mapping[str, float],
) -> FlightEvidence | NoEvidence:
    if summary["status"] != "scored":
        return NoEvidence(NOT_SCORED, summary["reason"])
    grade, why = trust_grade(folder)
    if not reaches(grade, settings.lowest_grade):
        because = f" ({why})" if why else ""
        words = (
            f"its replay has trust grade {grade}{because}, and the decision takes none below {settings.lowest_grade}"
        )
        return NoEvidence(DISTRUSTED, words)
    aided = _aided(_read_scores(folder / "scores.parquet", _AIDED_COLUMNS), settings.sources)
    unaided = _unaided(_read_scores(folder / "withheld.parquet", _UNAIDED_COLUMNS), settings.withheld_sources)
    smoothed = _smoothed(_read_scores(folder / "smoothed.parquet", _SMOOTHED_COLUMNS))
    evidence = flight_evidence(summary["flight"], aided, unaided, whiteness, settings, smoothed)
    if evidence is None and aided is not None:
        return NoEvidence(MISLEADING, _why_misleading(aided, whiteness, settings))
    if evidence is None or present not in evidence.sets:
        return NoEvidence(WITHOUT_SAMPLES, f"the flight has nothing of {', '.join(settings.sources)} to judge by")
    return evidence


_KEY = ("set", "source", "axis", "block")
_AIDED_COLUMNS = (*_KEY, "n", "sum_nis_winsorised", "sum_log_variance")
_UNAIDED_COLUMNS = (*_KEY, "horizon_s", "error_winsorised")
_SMOOTHED_COLUMNS = (*_KEY, "n", "sum_squares_winsorised")


def _read_scores(path: Path, columns: Sequence[str]) -> pa.Table:
    return read_table(path, columns, words=("set", "source"))


def _why_misleading(aided: BlockSums, whiteness: Mapping[str, float], settings: DecisionSettings) -> str:
    shares = [
        f"{source} {whiteness[source]:.2f}"
        for source in settings.sources
        if source in whiteness and source in {name for name, _ in aided.columns}
    ]
    return (
        "nothing on this flight can be trusted to tell sets apart: the errors of its sensors wander "
        f"(white share of {', '.join(shares)}), so that a filter which follows them predicts best, and there is no "
        "time without GNSS to judge by instead"
    )


def trust_grade(folder: AnyPath) -> tuple[str | None, str]:
    """How far the replay of a flight can be trusted, "A" to "D", and why no further.

    The grade is None where there was nothing to compare the replay with.
    """
    folder = Path(folder)
    path = folder / "fidelity.json"
    if not path.is_file():
        return None, ""
    fidelity = read_document(path)
    trust = fidelity.get("trust", {})
    return (str(fidelity["grade"]) if trust.get("is_compared") else None), trust.get("reason", "")


def white_shares(metrics: pa.Table, present: str) -> dict[str, float]:
    """How white the error of each source is on this flight, 0 … 1: the mean over its axes."""
    rows = metrics.filter(pc.and_(pc.equal(metrics["metric"], "white_share"), pc.equal(metrics["set"], present)))
    found: dict[str, list[float]] = {}
    for source, axis, value in zip(*(rows[name].to_pylist() for name in ("source", "axis", "value")), strict=True):
        if axis in AXES and np.isfinite(value):
            found.setdefault(source, []).append(value)
    return {source: float(np.mean(values)) for source, values in found.items()}


def flight_evidence(
    flight: str,
    aided: BlockSums | None,
    unaided: BlockSums | None,
    whiteness: Mapping[str, float],
    settings: DecisionSettings,
    smoothed: BlockSums | None = None,
) -> FlightEvidence | None:
    """Weigh the columns and aims of a flight.

    A source is a witness of the aided prediction only as far as its errors are white: a filter that follows a
    wandering error predicts it well. What weight it lacks the smoothed velocity has, which takes the wander for the
    receiver's. Where no source is white enough, and there is nothing else, there is no evidence: None.
    """
    parts, share = {}, 0.0
    if unaided is not None:
        parts[UNAIDED] = (unaided, _weights(unaided, settings.withheld_sources), settings.unaided_weight)
    if aided is not None:
        trust = {source: settings.trust(whiteness.get(source, 1.0)) for source in settings.sources}
        trusted = {source: weight * trust[source] for source, weight in settings.sources.items()}
        present = {source for source, _ in aided.columns}
        full = sum(settings.sources[source] for source in present)
        share = sum(trusted[source] for source in present) / full if full else 0.0
        if share > 0.0 and settings.aided_weight > 0.0:
            parts[AIDED] = (aided, _weights(aided, trusted), settings.aided_weight * share)
    if smoothed is not None and settings.smoothed_weight > 0.0:
        by_axis = {f"{source}.{axis}": settings.smoothed_axes.get(axis, 0.0) for source, axis in _axes_of(smoothed)}
        parts[SMOOTHED] = (smoothed, _weights(smoothed, by_axis), settings.smoothed_weight * (1.0 - share))
    # The smoothed velocity may prove a set better even where it has no weight in the score.
    parts = {name: part for name, part in parts.items() if (part[2] > 0.0 or name == SMOOTHED) and part[1].any()}
    if not any(part[2] > 0.0 for part in parts.values()):
        return None
    total = sum(weight for _, _, weight in parts.values())
    everywhere = set.intersection(*(set(part[0].sets) for part in parts.values()))
    sets = [name for name in next(iter(parts.values()))[0].sets if name in everywhere]
    aims = [_aim(name, *parts[name], sets, total) for name in AIMS if name in parts]
    # An error of exactly 0, or one that is no number, has no logarithm: such a set has no score.
    able = np.all([np.isfinite(aim.scores) for aim in aims], axis=0)
    named = tuple(name for name, one in zip(sets, able, strict=True) if one)
    return FlightEvidence(flight, named, tuple(_of_sets(aim, able) for aim in aims)) if named else None


def _of_sets(aim: AimEvidence, rows: npt.NDArray[np.bool_]) -> AimEvidence:
    return replace(aim, sum_nis=aim.sum_nis[rows], sum_log_variance=aim.sum_log_variance[rows])


def _weights(sums: BlockSums, weight_of: Mapping[str, float]) -> Array:
    """Weights of the columns; a key of `weight_of`, a source or one axis of it, shares its weight among its columns."""
    weights = np.zeros(len(sums.columns))
    for key, weight in weight_of.items():
        source, _, axis = key.partition(".")
        matching = [one == source and (not axis or label.split()[1] == axis) for one, label in sums.columns]
        weights += np.array(matching) * weight / max(sum(matching), 1)
    total = weights.sum()
    return np.asarray(weights / total if total > 0.0 else weights)


def _aim(
    name: str, sums: BlockSums, column_weights: Array, weight: float, sets: Sequence[str], total: float
) -> AimEvidence:
    used = column_weights > 0.0
    place = {one: row for row, one in enumerate(sums.sets)}
    rows = [place[one] for one in sets]
    return AimEvidence(
        name=name,
        weight=weight / total,
        columns=tuple(label for (_, label), use in zip(sums.columns, used, strict=True) if use),
        column_weights=column_weights[used],
        n=sums.n[:, used],
        sum_nis=sums.sum_nis[rows][:, :, used],
        sum_log_variance=sums.sum_log_variance[rows][:, :, used],
    )


def _aided(table: pa.Table, weights: Mapping[str, float]) -> BlockSums | None:
    table = table.filter(pc.is_in(table["source"], value_set=pa.array(_weighted(weights))))
    if table.num_rows == 0:
        return None
    columns = {
        "n": table["n"].to_numpy(),
        "sum_nis": table["sum_nis_winsorised"].to_numpy(),
        "sum_log_variance": table["sum_log_variance"].to_numpy(),
    }
    return _block_sums(table, columns)


def _unaided(table: pa.Table, weights: Mapping[str, float]) -> BlockSums | None:
    """Sums over the gaps that begin in a block. Of the error alone: the variance that a filter claims after seconds
    follows from its noise settings, and profiling would leave only how it varies between gaps."""
    table = table.filter(pc.is_in(table["source"], value_set=pa.array(_weighted(weights))))
    if table.num_rows == 0:
        return None
    error = table["error_winsorised"].to_numpy()
    columns = {"n": np.ones(error.size), "sum_nis": np.square(error), "sum_log_variance": np.zeros(error.size)}
    return _block_sums(table, columns, table["horizon_s"].to_numpy())


def _smoothed(table: pa.Table) -> BlockSums | None:
    """Sums of the squared differences to the smoothed velocity: of the error alone, as no set knows its variance."""
    if table.num_rows == 0:
        return None
    squares = table["sum_squares_winsorised"].to_numpy()
    columns = {"n": table["n"].to_numpy(), "sum_nis": squares, "sum_log_variance": np.zeros(squares.size)}
    return _block_sums(table, columns)


def _axes_of(sums: BlockSums) -> list[tuple[str, str]]:
    """Source and axis of each column."""
    return [(source, label.split()[1]) for source, label in sums.columns]


def _weighted(weights: Mapping[str, float]) -> list[str]:
    """Sources that have a weight, whole or in one axis."""
    return sorted({key.partition(".")[0] for key, weight in weights.items() if weight > 0.0})


def _block_sums(table: pa.Table, values: Mapping[str, npt.NDArray[Any]], horizon: Array | None = None) -> BlockSums:
    """Add up rows by set, block and column: a source, its axis and, where there is one, the horizon (N,) in seconds."""
    names, sources = (sorted(table[name].unique().to_pylist()) for name in ("set", "source"))
    set_index, source = places(table["set"], names), places(table["source"], sources)
    blocks, block_index = np.unique(table["block"].to_numpy(), return_inverse=True)
    times = np.zeros(1) if horizon is None else np.unique(horizon)
    time = 0 if horizon is None else np.searchsorted(times, horizon)
    number = (source * len(AXES) + table["axis"].to_numpy()) * times.size + time
    found, column_index = np.unique(number, return_inverse=True)
    parts = zip(*np.unravel_index(found, (len(sources), len(AXES), times.size)), strict=True)
    pairs = [
        (sources[one], AXES[axis] if horizon is None else f"{AXES[axis]} after {times[number]:g} s")
        for one, axis, number in parts
    ]
    columns = sorted(pairs)
    column_index = np.array([columns.index(pair) for pair in pairs])[column_index]
    shape = (len(names), blocks.size, len(columns))
    cell = np.ravel_multi_index((set_index, block_index, column_index), shape)
    sums = {name: np.bincount(cell, value, minlength=math.prod(shape)).reshape(shape) for name, value in values.items()}
    # A set with another number of samples did not share the source with the others; it has no paired score.
    count = sums["n"].sum(axis=(1, 2))
    complete = count == count.max()
    return BlockSums(
        sets=tuple(name for name, one in zip(names, complete, strict=True) if one),
        columns=tuple((one, f"{one} {text}") for one, text in columns),
        n=sums["n"][complete][0],
        sum_nis=sums["sum_nis"][complete],
        sum_log_variance=sums["sum_log_variance"][complete],
    )
