"""The evidence of each flight: the sums over blocks that every parameter set reached on the same samples."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow.compute as pc

from fusetune.analyze.likelihood import profile_nll
from fusetune.parquet import read_table

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class FlightEvidence:
    """Block sums of the deciding source on one flight.

    Attributes
    ----------
    sets : (S,) names of the sets scored on this flight
    n : (B, A) samples per block and axis, the same for all sets
    sum_nis, sum_log_variance : (S, B, A) sums of ν²/S and ln S
    """

    flight: str
    sets: tuple[str, ...]
    n: Array
    sum_nis: Array
    sum_log_variance: Array

    @property
    def scores(self) -> Array:
        """(S,) scale-profiled NLL of the flight, summed over the axes, nat."""
        return score_of_sums(self.n.sum(axis=0), self.sum_nis.sum(axis=1), self.sum_log_variance.sum(axis=1))


@dataclass(frozen=True)
class AnalyzedFlight:
    """What the analyze room says about one flight: the summary, and the evidence or the reason why there is none."""

    name: str
    folder: Path
    summary: dict[str, Any]
    evidence: FlightEvidence | None
    reason: str


def score_of_sums(n: Array, sum_nis: Array, sum_log_variance: Array) -> Array:
    """Scale-profiled NLL, summed over the last axis (the axes of the source), from its additive parts.

    One free scale per flight and axis; see `fusetune.analyze.likelihood.profile_nll`.
    """
    return profile_nll(sum_nis / n, sum_log_variance / n).sum(axis=-1)


def read_flight(folder: Path, source: str, present: str) -> AnalyzedFlight:
    """Read the scores of one flight from `results/analyze/<flight>`."""
    summary = json.loads((folder / "scoring.json").read_text(encoding="utf-8"))
    name = summary["flight"]
    if summary["status"] != "scored":
        return AnalyzedFlight(name, folder, summary, None, summary["reason"])
    table = read_table(folder / "scores.parquet")
    table = table.filter(pc.equal(table["source"], source))
    evidence = _evidence(name, table)
    if evidence is None or present not in evidence.sets:
        return AnalyzedFlight(name, folder, summary, None, f"the flight has no {source} samples to score")
    return AnalyzedFlight(name, folder, summary, evidence, "")


def read_flights(folders: Sequence[Path], source: str, present: str) -> list[AnalyzedFlight]:
    """Read all flights, ordered by name so that the order of the arguments does not matter."""
    return sorted((read_flight(Path(folder), source, present) for folder in folders), key=lambda one: one.name)


def _evidence(flight: str, table: Any) -> FlightEvidence | None:
    if table.num_rows == 0:
        return None
    names, set_index = np.unique(np.asarray(table["set"].to_pylist()), return_inverse=True)
    blocks, block_index = np.unique(table["block"].to_numpy(), return_inverse=True)
    axes, axis_index = np.unique(table["axis"].to_numpy(), return_inverse=True)
    shape = (names.size, blocks.size, axes.size)
    filled = {}
    for column in ("n", "sum_nis", "sum_log_variance"):
        filled[column] = np.zeros(shape)
        filled[column][set_index, block_index, axis_index] = table[column].to_numpy()
    # A set with another number of samples did not share the source with the others; it has no paired score.
    complete = filled["n"].sum(axis=(1, 2)) == filled["n"].sum(axis=(1, 2)).max()
    return FlightEvidence(
        flight=flight,
        sets=tuple(str(name) for name in names[complete]),
        n=filled["n"][complete][0],
        sum_nis=filled["sum_nis"][complete],
        sum_log_variance=filled["sum_log_variance"][complete],
    )
