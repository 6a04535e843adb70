"""The decision of version 0.1, kept as it was, to be judged beside the one in use.

Aims: one step ahead, and 9 s without GNSS; the first as far as the receiver's error is white, and alone where there is
nothing else. A set replaces the present one if nothing is held against it, its interval of the hierarchical bootstrap
lies below 0, and its t is beyond that of the luckiest candidate in 95 % of the flips of the flights' signs; of sets
within a standard error and 1 % of the best the nearest to PX4's defaults is taken.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
from scipy.special import ndtr, stdtrit

from fusetune.analyze.metrics.likelihood import profile_nll
from fusetune.apply.evidence import AimEvidence, FlightEvidence
from fusetune.storage.documents import read_document
from fusetune.storage.parquet import read_table

Array = npt.NDArray[np.float64]

AIDED, UNAIDED = "aided", "unaided"
AIDED_SOURCE = "gnss_vel"
UNAIDED_COLUMNS = {("gnss_pos", 0): 1.5, ("gnss_pos", 1): 1.5, ("gnss_vel", 2): 1.0}
"""Source and axis → weight of its three horizons together."""
DISTRUST, TRUST = 0.6, 0.9
CONFIDENCE, DRAWS, INNER = 0.95, 400, 100
MOST_KEPT = 500
"""Aims of which the redrawn blocks are kept."""
EQUIVALENCE = math.log(1.01)
EQUAL = 1e-9


def read_old_evidence(folders: Sequence[Path], present: str) -> list[FlightEvidence | None]:
    """Block sums of the old aims of each flight, weighted, in the order of the folders; None where it has none."""
    shares = [_white_share(read_table(folder / "metrics.parquet"), present) for folder in folders]
    known = [share for share in shares if share is not None]
    usual = float(np.mean(known)) if known else 1.0
    return [
        _weighted(folder.name, read_old_aims(folder), usual if share is None else share, present)
        for folder, share in zip(folders, shares, strict=True)
    ]


def _white_share(metrics: pa.Table, present: str) -> float | None:
    columns = (metrics[name].to_pylist() for name in ("set", "source", "axis", "metric", "value"))
    values = [
        value
        for one, source, axis, metric, value in zip(*columns, strict=True)
        if metric == "white_share" and one == present and source == AIDED_SOURCE and axis in "xyz" and value == value
    ]
    return float(np.mean(values)) if values else None


Aim = tuple[list[str], AimEvidence]
"""Names of the sets, and their evidence with weight 1."""


def read_old_aims(folder: Path) -> dict[str, Aim]:
    """The aims of which the flight has anything."""
    if read_document(folder / "scoring.json")["status"] != "scored":
        return {}
    scores, withheld = (_columns(read_table(folder / f"{name}.parquet")) for name in ("scores", "withheld"))
    aims = {}
    one_step = scores["source"] == AIDED_SOURCE
    if one_step.any():
        labels = scores["axis"].astype(str)
        values = (scores["n"].astype(float), scores["sum_nis_winsorised"], scores["sum_log_variance"])
        aims[AIDED] = _sums(AIDED, scores, labels, one_step, values, dict.fromkeys(labels[one_step], 1.0))
    keys = list(zip(withheld["source"].tolist(), withheld["axis"].tolist(), strict=True))
    chosen = np.array([key in UNAIDED_COLUMNS for key in keys], np.bool_)
    if chosen.any():
        labels = np.array(
            [f"{key[0]} {key[1]} {horizon:g}" for key, horizon in zip(keys, withheld["horizon_s"], strict=True)]
        )
        weights = {label: UNAIDED_COLUMNS[key] for label, key, use in zip(labels, keys, chosen, strict=True) if use}
        squares = np.square(withheld["error_winsorised"])
        values = (np.ones(squares.size), squares, np.zeros(squares.size))
        aims[UNAIDED] = _sums(UNAIDED, withheld, labels, chosen, values, weights)
    return aims


def _weighted(flight: str, aims: Mapping[str, Aim], white_share: float, present: str) -> FlightEvidence | None:
    trust = min(max((white_share - DISTRUST) / (TRUST - DISTRUST), 0.0), 1.0)
    weights = {AIDED: trust if UNAIDED in aims or trust > 0.0 else 1.0, UNAIDED: 1.0}
    used = {name: aim for name, aim in aims.items() if weights[name] > 0.0}
    total = sum(weights[name] for name in used)
    sets = (
        [one for one in next(iter(used.values()))[0] if all(one in names for names, _ in used.values())] if used else []
    )
    if present not in sets:
        return None
    found = tuple(
        replace(
            aim,
            weight=weights[name] / total,
            sum_nis=aim.sum_nis[rows],
            sum_log_variance=aim.sum_log_variance[rows],
        )
        for name, (names, aim) in used.items()
        for rows in [[names.index(one) for one in sets]]
    )
    return FlightEvidence(flight, tuple(sets), found)


def _columns(table: pa.Table) -> dict[str, npt.NDArray[Any]]:
    return {name: np.asarray(table[name].to_pylist()) for name in table.column_names}


def _sums(
    name: str,
    table: Mapping[str, npt.NDArray[Any]],
    labels: npt.NDArray[Any],
    rows: npt.NDArray[np.bool_],
    values: Sequence[Array],
    weights: Mapping[str, float],
) -> Aim:
    sets, of_set = np.unique(table["set"][rows], return_inverse=True)
    blocks, of_block = np.unique(table["block"][rows], return_inverse=True)
    columns, of_column = np.unique(labels[rows], return_inverse=True)
    sums = np.zeros((3, sets.size, blocks.size, columns.size))
    for total, value in zip(sums, values, strict=True):
        np.add.at(total, (of_set, of_block, of_column), value[rows])
    counts = sums[0].sum(axis=(1, 2))
    whole = counts == counts.max()
    share = np.array([weights[one] for one in columns])
    names = [str(one) for one in sets[whole]]
    n, nis, log_variance = sums[0][whole][0], sums[1][whole], sums[2][whole]
    return names, AimEvidence(name, 1.0, tuple(map(str, columns)), share / share.sum(), n, nis, log_variance)


def old_vetoes(sets: Sequence[str], folders: Sequence[Path], present: str) -> dict[str, str]:
    """What is held against a set, from all flights: the first reason."""
    summaries = [read_document(folder / "scoring.json") for folder in folders]
    summaries = [one for one in summaries if one["status"] == "scored"]
    vetoed: dict[str, str] = {}
    for name in sets:
        own, base = ([one["sets"][key] for one in summaries] for key in (name, present))
        for kind in ("resets", "timeouts"):
            counts = [sum(sum(one[kind].values()) for one in ones) for ones in (own, base)]
            if counts[0] > counts[1]:
                vetoed.setdefault(name, f"{counts[0]} {kind}, the present set has {counts[1]}")
        for one, its in zip(own, base, strict=True):
            if one["status"] != "scored":
                vetoed.setdefault(name, one["reason"] or one["status"])
            if set(one["faults"]) - set(its["faults"]) or (one["fault_flags"] and not its["fault_flags"]):
                vetoed.setdefault(name, "filter fault")
    for folder in folders:
        rates = _break_rates(read_table(folder / "metrics.parquet"))
        for (name, *source), (lower, _) in rates.items():
            base_rate = rates.get((present, *source))
            if name != present and base_rate is not None and lower > base_rate[1]:
                vetoed.setdefault(name, "more samples beyond the gate")
    return {name: why for name, why in vetoed.items() if name in sets and name != present}


def _break_rates(metrics: pa.Table) -> dict[tuple[str, ...], tuple[float, float]]:
    names = ("set", "source", "axis", "metric", "lower", "upper")
    columns = (metrics[name].to_pylist() for name in names)
    return {
        (one, source, axis): (lower, upper)
        for one, source, axis, metric, lower, upper in zip(*columns, strict=True)
        if metric == "break_rate_gate" and axis in ("x", "y", "z")
    }


class OldRule:
    """The old choice. Redrawn blocks of a flight are kept, for studies take the same flights again and again."""

    def __init__(self) -> None:
        self._redrawn: dict[int, tuple[AimEvidence, Array]] = {}

    def choose(
        self,
        flights: Sequence[FlightEvidence],
        names: Sequence[str],
        vetoed: Mapping[str, str],
        distances: Mapping[str, float],
    ) -> str:
        """The set to fly; the first of the names is the present one."""
        present, names = names[0], [one for one in names if all(one in flight.sets for flight in flights)]
        if present not in names:
            return present
        generator = np.random.default_rng(20)
        picks = generator.integers(0, len(flights), (DRAWS, len(flights)))
        inner = generator.integers(0, INNER, picks.shape)
        rows = [[flight.sets.index(one) for one in names] for flight in flights]
        worse = np.zeros(len(names), np.bool_)
        total, drawn = np.zeros((len(flights), len(names))), np.zeros((DRAWS, len(names)))
        for aim in (AIDED, UNAIDED):
            parts = [next((one for one in flight.aims if one.name == aim), None) for flight in flights]
            own = np.array([np.nan if part is None else part.weight for part in parts])
            has = np.isfinite(own)
            if not has.any():
                continue
            found = np.zeros_like(total)
            pool = np.zeros((len(flights), INNER, len(names)))
            for index, part in enumerate(parts):
                if part is not None:
                    found[index] = _to_present(part.scores[rows[index]])
                    pool[index] = _to_present(self._of(part)[:, rows[index]])
            redrawn = pool[picks, inner]
            weight = np.where(has, own, 0.0)
            total += weight[:, None] * found
            drawn += (weight[picks][:, :, None] * redrawn).mean(axis=1)
            number = has[picks].sum(axis=1)
            with np.errstate(invalid="ignore", divide="ignore"):
                means = redrawn.sum(axis=1) / number[:, None]
            worse |= _interval(means[number > 0], found[has])[0] > 0.0
        _, upper = _interval(drawn, total)
        p_values = np.ones(len(names))
        able = [index for index in range(1, len(names)) if names[index] not in vetoed and not worse[index]]
        if able:
            p_values[able] = _family_p_values(total[:, able])
        proved = [index for index in able if upper[index] < 0.0 and p_values[index] <= 1.0 - CONFIDENCE]
        if not proved:
            return present
        mean = total.mean(axis=0)
        first = min(proved, key=lambda index: (mean[index], names[index]))
        units = len(flights)
        behind = np.std(drawn - drawn[:, [first]], axis=0) * math.sqrt(units / (units - 1.0))
        near = [index for index in proved if mean[index] - mean[first] <= min(behind[index], EQUIVALENCE)]
        return names[min([first, *near], key=lambda index: (distances[names[index]], mean[index], names[index]))]

    def _of(self, aim: AimEvidence) -> Array:
        """(INNER, S) scores with the blocks drawn anew."""
        if id(aim) not in self._redrawn:
            if len(self._redrawn) >= MOST_KEPT:
                self._redrawn.clear()
            self._redrawn[id(aim)] = (aim, _blocks_redrawn(aim, np.random.default_rng(len(self._redrawn))))
        return self._redrawn[id(aim)][1]


def _blocks_redrawn(aim: AimEvidence, generator: np.random.Generator) -> Array:
    blocks = len(aim.n)
    picks = generator.integers(0, blocks, (INNER, blocks))
    times = (picks[:, :, None] == np.arange(blocks)).sum(axis=1).astype(np.float64)
    n = times @ aim.n
    nis, log_variance = (np.einsum("db,sba->dsa", times, sums) for sums in (aim.sum_nis, aim.sum_log_variance))
    with np.errstate(invalid="ignore", divide="ignore"):
        scores = profile_nll(nis / n[:, None], log_variance / n[:, None])
    return np.asarray(np.where(n[:, None] > 0.0, scores, aim.column_scores) @ aim.column_weights)


def _to_present(scores: Array) -> Array:
    differences = scores - scores[..., :1]
    return np.where(np.abs(differences) <= EQUAL, 0.0, differences)


def _interval(draws: Array, found: Array) -> tuple[Array, Array]:
    """Lower and upper ends (S,) of the intervals of mean differences; infinite where nothing shows the spread."""
    units = len(found)
    if units < 2:
        return np.full(found.shape[1], -np.inf), np.full(found.shape[1], np.inf)
    centre, spread = draws.mean(axis=0), draws.std(axis=0)
    if units > 2:
        narrower = np.minimum(1.0, found.std(axis=0) / math.sqrt(units) / np.maximum(spread, EQUAL))
        draws, spread = centre + (draws - centre) * narrower, spread * narrower
    quantile = float(stdtrit(units - 1, 0.5 * (1.0 - CONFIDENCE)))
    error = spread * math.sqrt(units / (units - 1.0))
    if units < 5:
        lower, upper = centre + quantile * error, centre - quantile * error
    else:
        tail = float(ndtr(math.sqrt(units / (units - 1.0)) * quantile))
        lower, upper = np.quantile(draws, (tail, 1.0 - tail), axis=0)
    flat = spread <= EQUAL
    return np.where(flat, -np.inf, lower), np.where(flat, np.inf, upper)


def _family_p_values(differences: Array) -> Array:
    """(C,) one-sided single-step max-t p-values of (F, C) differences over all flips of the flights' signs."""
    flights = len(differences)
    if flights < 2:
        return np.ones(differences.shape[1])
    signs = np.array(list(itertools.product((1.0, -1.0), repeat=flights)))
    squares = np.square(differences).sum(axis=0)

    def statistic(mean: Array) -> Array:
        error = np.sqrt(np.maximum(squares - flights * np.square(mean), 0.0) / (flights - 1) / flights)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(mean == 0.0, 0.0, mean / error)

    found = statistic(differences.mean(axis=0))
    rivals = (found <= math.sqrt(2.0 * math.log(math.log(max(flights, 3))))) & (squares > 0.0)
    p_values = np.ones(differences.shape[1])
    if rivals.any():
        luckiest = statistic(signs @ differences / flights)[:, rivals].min(axis=1)
        p_values[rivals] = (luckiest[:, None] <= found[rivals] + EQUAL).mean(axis=0)
    return p_values
