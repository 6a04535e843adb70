"""One world as the rules see it, and as the judge sees it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from fusetune.analyze.delays.sensor_delays import SensorDelay, read_delays
from fusetune.apply.criteria import criteria, metrics_of, paper_entries
from fusetune.apply.evidence import AnalyzedFlight, FlightEvidence, read_flights
from fusetune.apply.paper_mode import paper_ranking
from fusetune.apply.settings import DecisionSettings
from fusetune.apply.vetoes import break_rates, vetoes
from fusetune.storage.documents import read_document

from .old_rule import AIDED, UNAIDED, old_vetoes, read_old_aims, read_old_evidence

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
    settings : by which the flights were weighed and vetoed
    folders : where the flights are
    flights : what the decision reads
    delays : of the sensors, as each flight tells them
    old_flights : what that of version 0.1 read of the same flights
    vetoed, old_vetoed : reasons against a set, from these flights
    figures : criteria of the innovations and scores of single aims, lower is better
    truth : the judge's figures on all flights of the world, whichever of them the others are of
    """

    name: str
    sets: tuple[str, ...]
    overrides: Mapping[str, Mapping[str, float]]
    settings: DecisionSettings
    folders: tuple[Path, ...]
    flights: tuple[AnalyzedFlight, ...]
    delays: tuple[tuple[SensorDelay, ...], ...]
    old_flights: tuple[FlightEvidence | None, ...]
    vetoed: Mapping[str, Sequence[str]]
    old_vetoed: Mapping[str, str]
    figures: dict[str, np.ndarray]
    truth: dict[str, np.ndarray]

    def true_error(self, quantity: str) -> np.ndarray:
        """(S,) mean over the flights."""
        return self.truth[quantity].mean(axis=0)

    @cached_property
    def quantities(self) -> tuple[str, ...]:
        """The judge's figures that these flights have: those too short for a gap have no drift."""
        return tuple(name for name in TRUTH if np.isfinite(self.truth[name]).all())

    @cached_property
    def true_errors(self) -> np.ndarray:
        """(quantities, S) the same of all."""
        return np.array([self.true_error(quantity) for quantity in self.quantities])

    def first(self, count: int) -> World:
        """What is known after the first flights; the truth is that of all."""
        folders, flights = self.folders[:count], self.flights[:count]
        return replace(
            self,
            folders=folders,
            flights=flights,
            delays=self.delays[:count],
            old_flights=self.old_flights[:count],
            vetoed=_vetoed(self.sets, flights, self.settings),
            old_vetoed=old_vetoes(self.sets, folders, self.sets[0]),
            figures={rule: rows[:count] for rule, rows in self.figures.items()},
        )


def read_world(
    name: str, folders: Sequence[Path], overrides: Mapping[str, Mapping[str, float]], settings: DecisionSettings
) -> World:
    """Read what the flights of a world left behind."""
    sets = tuple(overrides)
    present = sets[0]
    flights = read_flights(folders, settings, present)
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
            truth[quantity].append([indexed.get((one, *key), np.nan) for one in sets])
    ordered = tuple(sorted(folders, key=lambda folder: folder.name))
    assert [one.name for one in flights] == [one.name for one in ordered], f"{name}: flights named otherwise"
    old = read_old_evidence(ordered, present)
    return World(
        name=name,
        sets=sets,
        overrides=overrides,
        settings=settings,
        folders=ordered,
        flights=tuple(flights),
        delays=tuple(read_delays(read_document(folder / "delays.json")["delays"]) for folder in ordered),
        old_flights=tuple(old),
        vetoed=_vetoed(sets, flights, settings),
        old_vetoed=old_vetoes(sets, ordered, present),
        figures={rule: np.array(rows) for rule, rows in figures.items()} | _aims_alone(ordered, sets),
        truth={quantity: np.array(rows) for quantity, rows in truth.items()},
    )


def _vetoed(
    sets: Sequence[str], flights: Sequence[AnalyzedFlight], settings: DecisionSettings
) -> dict[str, Sequence[str]]:
    rates = break_rates(metrics_of(flights))
    reasons = {one: vetoes(one, sets[0], flights, rates, settings) for one in sets[1:]}
    return {one: why for one, why in reasons.items() if why}


def _aims_alone(folders: Sequence[Path], sets: Sequence[str]) -> dict[str, np.ndarray]:
    """(F, S) scores of one kind of prediction alone, the aided one whether its source is white or not."""
    names = {"one-step predictions alone": AIDED, "withheld GNSS alone": UNAIDED}
    found = {rule: np.full((len(folders), len(sets)), np.nan) for rule in names}
    for row, folder in enumerate(folders):
        aims = read_old_aims(folder)
        for rule, name in names.items():
            scored, aim = aims.get(name, ([], None))
            if aim is not None:
                found[rule][row] = [aim.scores[scored.index(one)] if one in scored else np.nan for one in sets]
    return found


def scores(flights: Sequence[AnalyzedFlight], sets: Sequence[str]) -> np.ndarray:
    """(F, S) scores of the sets on the flights; NaN where a flight has none of a set."""
    rows = np.full((len(flights), len(sets)), np.nan)
    for row, flight in zip(rows, flights, strict=True):
        evidence = flight.evidence
        if evidence is not None:
            row[:] = [evidence.scores[evidence.sets.index(name)] if name in evidence.sets else np.nan for name in sets]
    return rows


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
