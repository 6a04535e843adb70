"""What the report reads: the decision, and the figures and samples of all flights."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from fusetune.analyze.flight_files import SAMPLES_FILE
from fusetune.apply.history.entries import HISTORY_FILE
from fusetune.apply.ranking import NOT_ELIGIBLE, NOT_SCORED
from fusetune.apply.sensitivity.files import NOTHING_TOLD, SENSITIVITY_FILE, ToldSensitivity, read_sensitivity
from fusetune.px4.aid_sources import AID_SOURCES, AXES
from fusetune.report.scored_samples import scored_samples
from fusetune.report.set_styles import SetStyle, set_styles
from fusetune.set_names import ONBOARD
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_table

OUT = (NOT_ELIGIBLE, NOT_SCORED)
"""Parts in the decision of sets that cannot be chosen."""

MOST_SETS_SHOWN = 14
"""Box plots and tables of more sets than this are unreadable: the best and the present one are shown."""


@dataclass(frozen=True)
class Results:
    """Everything behind the report.

    Attributes
    ----------
    metrics : long table of the flights that decide
    ranking, per_flight : tables of the apply room
    shown : sets that plots show, in order of the ranking, the present one first
    scoring : summary of each analysed flight, by name
    sensitivity : what the sets tell of the parameters
    history : what was decided for the vehicle before, and what it brought; None where no history is kept
    """

    decision: dict[str, Any]
    ranking: pd.DataFrame
    per_flight: pd.DataFrame
    metrics: pd.DataFrame
    scoring: dict[str, dict[str, Any]]
    folders: dict[str, Path]
    shown: tuple[str, ...]
    present: str
    sensitivity: ToldSensitivity = NOTHING_TOLD
    history: dict[str, Any] | None = None

    @property
    def scored(self) -> tuple[str, ...]:
        """Scored flights, those too that have no say in the decision."""
        return tuple(name for name, summary in self.scoring.items() if summary["status"] == "scored")

    @property
    def flights(self) -> tuple[str, ...]:
        """Flights that decide: what the figures and tables that compare the sets are made of."""
        counted = _counted(self.decision)
        return tuple(name for name in self.scored if name in counted)

    def reason(self, name: str) -> str:
        """Why an analysed flight has no say in the decision; empty where it has."""
        if name in self.flights:
            return ""
        judged = {row["flight"]: row["reason"] for row in self.decision["flights"]}
        return str(judged.get(name) or self.scoring[name]["reason"])

    def status(self, name: str) -> str:
        """Part of a set in the decision, as `fusetune.apply.ranking` names it."""
        return str(self._ranked[name]["status"])

    def is_ruled_out(self, name: str) -> bool:
        """Whether a set cannot be chosen: vetoed, not scored, or worse than the present one in a kind of prediction."""
        return self.status(name) in OUT

    @cached_property
    def styles(self) -> dict[str, SetStyle]:
        """The look of every set that was tried."""
        return set_styles([*map(str, self.ranking["name"]), self.present], self.present, self.decision["chosen"])

    @cached_property
    def figure_rows(self) -> tuple[pd.DataFrame, dict[tuple[str, str, str], Any]]:
        """Metrics of the shown sets, and where those of each source, axis and metric are: they are asked for hundreds
        of times."""
        shown = self.metrics[self.metrics["set"].isin(self.shown)]
        places: Any = shown.groupby(["source", "axis", "metric"], observed=True).indices
        return shown, places

    @cached_property
    def _ranked(self) -> dict[str, dict[Hashable, Any]]:
        """Rows of the ranking by set: the figures ask for them hundreds of times."""
        return {row["name"]: row for row in self.ranking.to_dict("records")}


def read_results(analyze_folders: Sequence[AnyPath], apply_folder: AnyPath) -> Results:
    """Read the results of the rooms; nothing is searched for, only what is named is read.

    Parameters
    ----------
    analyze_folders : in the order in which flights are shown
    """
    apply_folder = Path(apply_folder)
    decision = read_document(apply_folder / "decision.json")
    ranking = read_table(apply_folder / "ranking.parquet").to_pandas()
    scoring, folders, metrics = {}, {}, []
    counted = _counted(decision)
    for folder in map(Path, analyze_folders):
        summary = read_document(folder / "scoring.json")
        scoring[summary["flight"]] = summary
        folders[summary["flight"]] = folder
        if summary["flight"] in counted:
            metrics.append(read_table(folder / "metrics.parquet").to_pandas())
    present = decision["present"]
    return Results(
        decision=decision,
        ranking=ranking,
        per_flight=read_table(apply_folder / "per_flight.parquet").to_pandas(),
        metrics=_categorical(pd.concat(metrics, ignore_index=True) if metrics else _empty_metrics()),
        scoring=scoring,
        folders=folders,
        sensitivity=read_sensitivity(apply_folder / SENSITIVITY_FILE),
        history=read_document(history) if (history := apply_folder / HISTORY_FILE).is_file() else None,
        shown=_shown(ranking, present),
        present=present,
    )


def _counted(decision: Mapping[str, Any]) -> set[str]:
    """Flights that have a say in a decision."""
    return {str(row["flight"]) for row in decision["flights"] if row["scored"]}


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
    """Scored innovations (unit of the source) and innovations divided by √S, over the flights that decide."""
    values: dict[tuple[str, int], dict[str, list[npt.NDArray[np.float64]]]] = {}
    normalised: dict[tuple[str, int], dict[str, list[npt.NDArray[np.float64]]]] = {}
    for flight in results.flights:
        for one in scored_samples(results.folders[flight] / SAMPLES_FILE, ("innovation", "innovation_variance")):
            if one.set_name in results.shown:
                innovation, variance = (column.astype(np.float64) for column in one.columns)
                key, scaled = (one.source, one.axis), innovation / np.sqrt(variance)
                values.setdefault(key, {}).setdefault(one.set_name, []).append(innovation)
                normalised.setdefault(key, {}).setdefault(one.set_name, []).append(scaled)
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
    metrics, rows = results.figure_rows
    return metrics.take(rows.get((source, axis, metric), np.zeros(0, np.intp)))


def as_flown(results: Results) -> pd.DataFrame:
    """Figures of the vehicle's own innovations."""
    return results.metrics[results.metrics["set"] == ONBOARD]
