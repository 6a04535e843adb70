"""All the other criteria, averaged over the flights, that stand beside the score in the ranking."""

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from fusetune.analyze.scoring.metrics_schema import METRICS_SCHEMA
from fusetune.apply.evidence import AnalyzedFlight
from fusetune.apply.paper_mode import PAPER_VARIABLES, PaperEntry, aggregate_rms
from fusetune.px4.aid_sources import AID_SOURCES, AXES

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
    names = {flight.name for flight in flights if flight.evidence is not None}
    by_metric = _indexed(metrics, names)
    return {name: _criteria_of(name, source, flights, by_metric) for name in sets}


def _indexed(metrics: pa.Table, flights: set[str]) -> dict[tuple[str, str, str, str], list[float]]:
    counted = pc.is_in(metrics["flight"], value_set=pa.array(sorted(flights), pa.string()))
    kept = metrics.filter(pc.and_(counted, pc.is_in(metrics["metric"], value_set=pa.array(_METRICS))))
    index: dict[tuple[str, str, str, str], list[float]] = defaultdict(list)
    columns = (kept[name].to_pylist() for name in ("set", "source", "axis", "metric", "value"))
    for set_name, source, axis, metric, value in zip(*columns, strict=True):
        if math.isfinite(value):
            index[set_name, source, axis, metric].append(value)
    return index


def _criteria_of(
    name: str, source: str, flights: Sequence[AnalyzedFlight], index: dict[tuple[str, str, str, str], list[float]]
) -> Criteria:
    def mean(figure_source: str, axis: str, metric: str) -> float:
        values = index.get((name, figure_source, axis, metric))
        return float(np.mean(values)) if values else math.nan

    result = {
        label.format(source=source): mean(where.format(source=source), axis, metric)
        for label, (where, axis, metric) in _FIGURES.items()
    }
    axes = [mean(source, axis, "lag1_correlation") for axis in AXES]
    known = [value for value in axes if math.isfinite(value)]
    result[f"lag1_{source}"] = float(np.mean(known)) if known else math.nan
    nlls = [mean(one, axis, "nll") for one in _AIDING for axis in AXES]
    known = [value for value in nlls if math.isfinite(value)]
    result["nll_all_sources"] = float(np.sum(known)) if known else math.nan
    rates = [mean(one, axis, "break_rate_gate") for one in _AIDING for axis in AXES]
    known = [value for value in rates if math.isfinite(value)]
    result["break_rate_gate"] = float(np.mean(known)) if known else math.nan
    rms = rms_by_variable(name, index)
    result["paper_aggregate_rms"] = aggregate_rms(rms)
    summaries = [flight.summary["sets"].get(name, {}) for flight in flights if flight.evidence is not None]
    for kind in ("resets", "timeouts"):
        result[kind] = float(sum(sum(summary.get(kind, {}).values()) for summary in summaries))
    result["faults"] = float(sum(bool(summary.get("fault_flags")) for summary in summaries))
    return result


def rms_by_variable(name: str, index: dict[tuple[str, str, str, str], list[float]]) -> dict[str, float]:
    """RMS innovation of the variables of the paper's table 12, averaged over the flights."""
    rms = {}
    for variable, places in PAPER_VARIABLES.items():
        found = [index[name, *place, "rms_innovation"] for place in places if (name, *place, "rms_innovation") in index]
        rms[variable] = float(np.mean(found[0])) if found else math.nan
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
    for row in metrics.filter(wanted).to_pylist():
        if row["axis"] == "all" and row["flight"] in names and is_known(row):
            inside.setdefault(row["set"], []).append(is_inside(row))
    entries = []
    for name in sets:
        consistent = bool(np.mean(inside[name]) >= 0.5) if name in inside else None
        rate = values[name]["break_rate_gate"]
        rate = 0.0 if math.isnan(rate) else rate
        entries.append(PaperEntry(name, values[name]["paper_aggregate_rms"], consistent, rate))
    return entries
