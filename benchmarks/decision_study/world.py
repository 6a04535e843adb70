"""One world as the rules see it, and as the judge sees it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fusetune.apply.criteria import criteria, metrics_of, paper_entries
from fusetune.apply.evidence import AnalyzedFlight, read_flights
from fusetune.apply.paper_mode import paper_ranking
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.vetoes import vetoes

TRUTH = {
    "velocity": ("truth_velocity", "all"),
    "attitude": ("truth_attitude_deg", "all"),
    "position": ("truth_position_mean_removed", "all"),
    "drift": ("truth_withheld_position", "horizontal"),
}
"""The judge's figures: RMSE of velocity (m/s), attitude (°), position less its mean error (m), and by how much the
horizontal position error grew in 9 s without GNSS (m)."""


PAPER_AGGREGATE = "paper, aggregate RMS"


@dataclass(frozen=True)
class World:
    """All flights of one world; arrays (F, S), the flights first.

    Attributes
    ----------
    sets : names, the present one first
    overrides : parameters of each set
    flights : what the decision reads
    vetoed : reasons against a set, from all flights
    figures : criteria of the innovations and scores of single aims, lower is better
    truth : the judge's figures
    """

    name: str
    sets: tuple[str, ...]
    overrides: Mapping[str, Mapping[str, float]]
    flights: tuple[AnalyzedFlight, ...]
    vetoed: Mapping[str, Sequence[str]]
    figures: dict[str, np.ndarray]
    truth: dict[str, np.ndarray]

    def true_error(self, quantity: str) -> np.ndarray:
        """(S,) mean over the flights."""
        return self.truth[quantity].mean(axis=0)


def read_world(
    name: str, folders: Sequence[Path], overrides: Mapping[str, Mapping[str, float]], settings: DecisionSettings
) -> World:
    """Read what the flights of a world left behind."""
    sets = tuple(overrides)
    present = sets[0]
    flights = read_flights(folders, settings, present)
    metrics = metrics_of(flights)
    reasons = {one: vetoes(one, present, flights, metrics, settings) for one in sets if one != present}
    figures: dict[str, list[list[float]]] = {}
    truth: dict[str, list[list[float]]] = {quantity: [] for quantity in TRUTH}
    for flight in flights:
        table = flight.metrics
        values = criteria(sets, settings.main_source, [flight], table)
        order = [entry.name for entry in paper_ranking(paper_entries(sets, [flight], table, values))]
        columns = {
            "minimum mean NIS": "mean_nis_gnss_vel",
            "J_NIS": "j_nis_gnss_vel",
            "C_NIS": "c_nis_gnss_vel",
            "NLL, all sources": "nll_all_sources",
            "NLL, GNSS velocity": "nll_gnss_vel",
        }
        rows = {rule: [values[one][column] for one in sets] for rule, column in columns.items()}
        rows["RMS, GNSS velocity"] = [_rms(values[one]) for one in sets]
        rows["paper mode"] = [float(order.index(one)) for one in sets]
        rows[PAPER_AGGREGATE] = [values[one]["paper_aggregate_rms"] for one in sets]
        for rule, row in rows.items():
            figures.setdefault(rule, []).append(row)
        indexed = _indexed(table, sets)
        for quantity, key in TRUTH.items():
            truth[quantity].append([indexed[(one, *key)] for one in sets])
    return World(
        name=name,
        sets=sets,
        overrides=overrides,
        flights=tuple(flights),
        vetoed={one: why for one, why in reasons.items() if why},
        figures={rule: np.array(rows) for rule, rows in figures.items()} | _aims_alone(folders, sets, settings),
        truth={quantity: np.array(rows) for quantity, rows in truth.items()},
    )


def _aims_alone(folders: Sequence[Path], sets: Sequence[str], settings: DecisionSettings) -> dict[str, np.ndarray]:
    """Scores of one kind of prediction alone, the aided one whether its source is white or not."""
    blind = replace(settings, unaided_weight=0.0, distrust_white_share=0.0, trust_white_share=0.0)
    alone = {"one-step predictions alone": blind, "withheld GNSS alone": replace(settings, aided_weight=0.0)}
    return {name: scores(read_flights(folders, one, sets[0]), sets) for name, one in alone.items()}


def scores(flights: Sequence[AnalyzedFlight], sets: Sequence[str]) -> np.ndarray:
    """(F, S) scores of the sets on the flights."""
    rows = []
    for flight in flights:
        evidence = flight.evidence
        assert evidence is not None, flight.reason
        rows.append([evidence.scores[evidence.sets.index(name)] for name in sets])
    return np.array(rows)


def _rms(values: Mapping[str, float]) -> float:
    return math.hypot(values["rms_gnss_vel_horizontal"], values["rms_gnss_vel_vertical"])


def _indexed(table, sets: Sequence[str]) -> dict[tuple[str, str, str], float]:  # type: ignore[no-untyped-def]
    wanted = set(TRUTH.values())
    columns = (table[name].to_pylist() for name in ("set", "source", "axis", "metric", "value"))
    return {
        (one, source, axis): value
        for one, source, axis, metric, value in zip(*columns, strict=True)
        if metric == "rmse" and (source, axis) in wanted
    }
