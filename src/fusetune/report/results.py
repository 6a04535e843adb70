"""What the report reads: the decision, and the figures and samples of all flights."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from fusetune.analyze.onboard import ONBOARD
from fusetune.analyze.sources import AID_SOURCES, AXES
from fusetune.apply.evidence import AIMS
from fusetune.documents import read_document
from fusetune.files import AnyPath
from fusetune.parquet import read_table

MOST_SETS_SHOWN = 14
"""Box plots and tables of more sets than this are unreadable: the best and the present one are shown."""


@dataclass(frozen=True)
class Results:
    """Everything behind the report.

    Attributes
    ----------
    metrics : long table of all flights
    ranking, per_flight : tables of the apply room
    shown : sets that plots show, in order of the ranking, the present one first
    scoring : summary of each analysed flight, by name
    """

    decision: dict[str, Any]
    ranking: pd.DataFrame
    per_flight: pd.DataFrame
    metrics: pd.DataFrame
    scoring: dict[str, dict[str, Any]]
    folders: dict[str, Path]
    shown: tuple[str, ...]
    present: str

    @property
    def flights(self) -> tuple[str, ...]:
        """Scored flights by name."""
        return tuple(name for name, summary in self.scoring.items() if summary["status"] == "scored")

    def status(self, name: str) -> str:
        """Part of a set in the decision: "present", "candidate", "vetoed" or "not_scored"."""
        return str(self._ranked[name]["status"])

    def is_ruled_out(self, name: str) -> bool:
        """Whether a set cannot be chosen: vetoed, not scored, or worse than the present one in a kind of prediction."""
        row = self._ranked[name]
        return name != self.present and (row["status"] != "candidate" or bool(worse_aims(row)))

    @cached_property
    def _ranked(self) -> dict[str, dict[Hashable, Any]]:
        """Rows of the ranking by set: the figures ask for them hundreds of times."""
        return {row["name"]: row for row in self.ranking.to_dict("records")}


def worse_aims(row: Mapping[Hashable, Any]) -> list[str]:
    """Kinds of prediction in which a set is worse than the present one beyond doubt, from its row of the ranking."""
    return [aim for aim in AIMS if row.get(f"{aim}_lower", 0.0) > 0.0]


def read_results(analyze_folders: Sequence[AnyPath], apply_folder: AnyPath) -> Results:
    """Read the results of the rooms; nothing is searched for, only what is named is read."""
    apply_folder = Path(apply_folder)
    decision = read_document(apply_folder / "decision.json")
    ranking = read_table(apply_folder / "ranking.parquet").to_pandas()
    scoring, folders, metrics = {}, {}, []
    for folder in sorted(map(Path, analyze_folders), key=lambda path: path.name):
        summary = read_document(folder / "scoring.json")
        scoring[summary["flight"]] = summary
        folders[summary["flight"]] = folder
        metrics.append(read_table(folder / "metrics.parquet").to_pandas())
    present = decision["present"]
    return Results(
        decision=decision,
        ranking=ranking,
        per_flight=read_table(apply_folder / "per_flight.parquet").to_pandas(),
        metrics=_categorical(pd.concat(metrics, ignore_index=True) if metrics else _empty_metrics()),
        scoring=scoring,
        folders=folders,
        shown=_shown(ranking, present),
        present=present,
    )


def _empty_metrics() -> pd.DataFrame:
    return pd.DataFrame(columns=["flight", "set", "source", "axis", "metric", "value", "lower", "upper", "n"])


def _categorical(metrics: pd.DataFrame) -> pd.DataFrame:
    """Names as categories: the figures select rows by them hundreds of times."""
    return metrics.astype(dict.fromkeys(("flight", "set", "source", "axis", "metric"), "category"))


def _shown(ranking: pd.DataFrame, present: str) -> tuple[str, ...]:
    names = [name for name in ranking["name"] if name != present][: MOST_SETS_SHOWN - 1]
    return (present, *names)


@dataclass(frozen=True)
class PooledSamples:
    """Scored samples of one source and axis by set, over all flights."""

    source: str
    axis: int
    innovation: dict[str, npt.NDArray[np.float64]]
    normalised: dict[str, npt.NDArray[np.float64]]

    @property
    def label(self) -> str:
        source = AID_SOURCES[self.source]
        return source.label + (f" {AXES[self.axis]}" if source.axes > 1 else "")


def pooled_samples(results: Results) -> list[PooledSamples]:
    """Scored innovations (unit of the source) and innovations divided by √S, over all scored flights."""
    values: dict[tuple[str, int], dict[str, list[npt.NDArray[np.float64]]]] = {}
    normalised: dict[tuple[str, int], dict[str, list[npt.NDArray[np.float64]]]] = {}
    for flight in results.flights:
        table = read_table(results.folders[flight] / "samples.parquet")
        frame = table.select(["set", "source", "axis", "innovation", "innovation_variance"]).to_pandas()
        for (source, axis, name), part in frame.groupby(["source", "axis", "set"], observed=True, sort=False):
            if name in results.shown:
                innovation = part["innovation"].to_numpy(np.float64)
                scaled = innovation / np.sqrt(part["innovation_variance"].to_numpy(np.float64))
                values.setdefault((str(source), int(axis)), {}).setdefault(str(name), []).append(innovation)
                normalised.setdefault((str(source), int(axis)), {}).setdefault(str(name), []).append(scaled)
    order = {name: index for index, name in enumerate(AID_SOURCES)}
    return [
        PooledSamples(
            source,
            axis,
            {name: np.concatenate(parts) for name, parts in values[source, axis].items()},
            {name: np.concatenate(parts) for name, parts in normalised[source, axis].items()},
        )
        for source, axis in sorted(values, key=lambda key: (order[key[0]], key[1]))
    ]


def figure_values(results: Results, source: str, axis: str, metric: str) -> pd.DataFrame:
    """Rows of one figure for the shown sets: flight, set, value, lower, upper, n."""
    metrics = results.metrics
    rows = metrics[(metrics["source"] == source) & (metrics["axis"] == axis) & (metrics["metric"] == metric)]
    return rows[rows["set"].isin(results.shown)]


def as_flown(results: Results) -> pd.DataFrame:
    """Figures of the vehicle's own innovations."""
    return results.metrics[results.metrics["set"] == ONBOARD]
