"""All the other criteria, averaged over the flights, that stand beside the score in the ranking."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from fusetune.analyze.scoring.metrics_schema import METRICS_SCHEMA
from fusetune.apply.evidence import AnalyzedFlight
from fusetune.apply.mean_figures import MeanFigures, of_known
from fusetune.apply.paper_mode import PAPER_VARIABLES, PaperEntry, aggregate_rms
from fusetune.px4.aid_sources import AID_SOURCES

Array = npt.NDArray[np.float64]
Criteria = dict[str, float]

_FIGURES = {
    "rms_{source}_horizontal": ("{source}", "horizontal", "rms_innovation"),
    "rms_{source}_vertical": ("{source}", "vertical", "rms_innovation"),
    "nll_{source}": ("{source}", "all", "nll"),
    "mean_nis_{source}": ("{source}", "all", "mean_nis"),
    "j_nis_{source}": ("{source}", "all", "j_nis"),
    "c_nis_{source}": ("{source}", "all", "c_nis"),
    "true_velocity_rmse": ("truth_velocity", "all", "rmse"),
    "true_position_rmse": ("truth_position", "all", "rmse"),
    "true_position_rmse_mean_removed": ("truth_position_mean_removed", "all", "rmse"),
    "true_attitude_rmse_deg": ("truth_attitude_deg", "all", "rmse"),
}
"""Criterion → source, axis and metric in the metrics table."""

_METRICS = sorted({metric for _, _, metric in _FIGURES.values()} | {"lag1_correlation", "break_rate_gate"})
"""What is looked up: a small part of what a flight has."""

_AIDING = tuple(source.name for source in AID_SOURCES.values() if source.summed)


def metrics_of(flights: Sequence[AnalyzedFlight]) -> pa.Table:
    """Metrics of some flights in one table, in the order of the flights."""
    return pa.concat_tables([flight.metrics for flight in flights]) if flights else METRICS_SCHEMA.empty_table()


def criteria(
    sets: Sequence[str], source: str, flights: Sequence[AnalyzedFlight], metrics: pa.Table
) -> dict[str, Criteria]:
    """Criteria of every set, each the mean over the scored flights that have it (counts are sums)."""
    scored = [flight for flight in flights if flight.evidence is not None]
    figures = MeanFigures(metrics, [flight.name for flight in scored], sets, _METRICS)
    columns = {
        label.format(source=source): figures.of(where.format(source=source), axis, metric)
        for label, (where, axis, metric) in _FIGURES.items()
    }
    columns[f"lag1_{source}"] = of_known(figures.by_axis([source], "lag1_correlation"), np.mean)
    columns["nll_all_sources"] = of_known(figures.by_axis(_AIDING, "nll"), np.sum)
    columns["break_rate_gate"] = of_known(figures.by_axis(_AIDING, "break_rate_gate"), np.mean)
    rms = rms_by_variable(figures)
    columns["paper_aggregate_rms"] = np.array([aggregate_rms(dict(zip(rms, one, strict=True))) for one in _rows(rms)])
    found = {name: dict(zip(columns, one, strict=True)) for name, one in zip(sets, _rows(columns), strict=True)}
    for name, own in found.items():
        own |= _events([flight.summary["sets"].get(name, {}) for flight in scored])
    return found


def _rows(columns: Mapping[str, Array]) -> Iterator[tuple[float, ...]]:
    return zip(*(values.tolist() for values in columns.values()), strict=True)


def _events(summaries: Sequence[Mapping[str, Any]]) -> Criteria:
    kinds = ("resets", "timeouts")
    result = {kind: float(sum(sum(summary.get(kind, {}).values()) for summary in summaries)) for kind in kinds}
    result["faults"] = float(sum(bool(summary.get("fault_flags")) for summary in summaries))
    return result


def rms_by_variable(figures: MeanFigures) -> dict[str, Array]:
    """RMS innovation of the variables of the paper's table 12 of all sets, averaged over the flights."""
    rms = {}
    for variable, (first, *others) in PAPER_VARIABLES.items():
        rms[variable] = figures.of(*first, "rms_innovation")
        for place in others:
            rms[variable] = np.where(np.isfinite(rms[variable]), rms[variable], figures.of(*place, "rms_innovation"))
    return rms


def is_known(row: Mapping[str, Any]) -> bool:
    """Whether a figure of the metrics has a value and bounds to hold it against."""
    return all(row[name] is not None and math.isfinite(row[name]) for name in ("lower", "value", "upper"))


def is_inside(row: Mapping[str, Any]) -> bool:
    """Whether a figure of the metrics lies inside its bounds."""
    return bool(row["lower"] <= row["value"] <= row["upper"])


def paper_entries(
    sets: Sequence[str], flights: Sequence[AnalyzedFlight], metrics: pa.Table, values: dict[str, Criteria]
) -> list[PaperEntry]:
    """What paper mode needs of every set; consistent means within the paper's bounds on at least half the flights."""
    names = {flight.name for flight in flights if flight.evidence is not None}
    wanted = pc.and_(pc.equal(metrics["metric"], "mean_nis"), pc.equal(metrics["source"], "gnss_vel"))
    inside: dict[str, list[bool]] = {}
    for row in metrics.filter(pc.and_(wanted, pc.equal(metrics["axis"], "all"))).to_pylist():
        if row["flight"] in names and is_known(row):
            inside.setdefault(row["set"], []).append(is_inside(row))
    entries = []
    for name in sets:
        consistent = bool(np.mean(inside[name]) >= 0.5) if name in inside else None
        rate = values[name]["break_rate_gate"]
        rate = 0.0 if math.isnan(rate) else rate
        entries.append(PaperEntry(name, values[name]["paper_aggregate_rms"], consistent, rate))
    return entries
