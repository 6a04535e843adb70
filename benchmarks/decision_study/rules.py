"""The rules that are compared: each chooses one set of a study from some flights, without the truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from fusetune.analyze.delays.settings import DelaySettings
from fusetune.analyze.delays.wrong_delays import STEP_MS, join_delays, mended_values
from fusetune.apply.choice import Choice, choose, choose_after_mending, parameter_distance
from fusetune.apply.evidence import AnalyzedFlight
from fusetune.apply.ranking import RankedSet, rank
from fusetune.apply.settings import DecisionSettings

from .old_rule import OldRule
from .world import PAPER_AGGREGATE, World, scores

Rule = Callable[[World, Sequence[int], Sequence[int]], int]
"""World, flights, sets of the study (the present one first) → the chosen one of these sets."""

OURS, OLD, SCORE_ONLY = "fusetune", "fusetune 0.1", "fusetune, lowest score"

DEFAULTS = {
    "EKF2_ACC_NOISE": 0.35,
    "EKF2_GYR_NOISE": 0.015,
    "EKF2_ACC_B_NOISE": 0.003,
    "EKF2_GYR_B_NOISE": 0.001,
    "EKF2_GPS_V_NOISE": 0.3,
    "EKF2_GPS_P_NOISE": 0.5,
    "EKF2_BARO_NOISE": 3.5,
    "EKF2_MAG_NOISE": 0.05,
    "EKF2_GPS_DELAY": 110.0,
}


def rules(settings: DecisionSettings) -> dict[str, Rule]:
    """All rules by name."""
    plain = (
        "minimum mean NIS",
        "paper mode",
        "J_NIS",
        "C_NIS",
        "RMS, GNSS velocity",
        "NLL, all sources",
        "NLL, GNSS velocity",
        "one-step predictions alone",
        "withheld GNSS alone",
    )
    return {
        **{name: _lowest(name) for name in plain},
        "paper's design, a flight per set": _flight_per_set,
        SCORE_ONLY: _lowest_score,
        OLD: old_rule(OldRule()),
        OURS: lambda world, flights, sets: decide(world, flights, sets, settings)[0],
    }


def _lowest_score(world: World, flights: Sequence[int], sets: Sequence[int]) -> int:
    return _lowest_mean(scores(world.flights, world.sets)[np.ix_(flights, sets)], sets)


def _lowest_mean(rows: np.ndarray, sets: Sequence[int]) -> int:
    """Over the flights that tell of all sets that any flight tells of; the present set where there are none."""
    told = np.isfinite(rows).any(axis=0)
    usable = rows[np.isfinite(rows[:, told]).all(axis=1)]
    return int(sets[int(np.nanargmin(np.where(told, usable.mean(axis=0), np.inf)))]) if len(usable) else int(sets[0])


def old_rule(rule: OldRule) -> Rule:
    """The decision of version 0.1 on what it read of the flights."""

    def choose_by_it(world: World, flights: Sequence[int], sets: Sequence[int]) -> int:
        read = [one for one in (world.old_flights[index] for index in flights) if one is not None]
        names = [world.sets[index] for index in sets]
        distances = {name: parameter_distance(world.overrides[name], DEFAULTS) for name in names}
        return world.sets.index(rule.choose(read, names, world.old_vetoed, distances)) if read else int(sets[0])

    return choose_by_it


def _lowest(name: str) -> Rule:
    return lambda world, flights, sets: _lowest_mean(world.figures[name][np.ix_(flights, sets)], sets)


def _flight_per_set(world: World, flights: Sequence[int], sets: Sequence[int]) -> int:
    """Each set is judged on another flight, as in the paper's experiment."""
    aggregate = world.figures[PAPER_AGGREGATE]
    own = [aggregate[flights[place % len(flights)], index] for place, index in enumerate(sets)]
    return int(sets[int(np.argmin(own))])


def decide(
    world: World, flights: Sequence[int], sets: Sequence[int], settings: DecisionSettings
) -> tuple[int, list[RankedSet]]:
    """The product's own decision on some flights: the chosen set, and the ranking."""
    names = [world.sets[index] for index in sets]
    # A flight that was drawn twice counts as two.
    chosen = [_named(world.flights[index], f"{number}") for number, index in enumerate(flights)]
    ranked = rank(names, names[0], chosen, world.vetoed, settings)
    distances = {name: parameter_distance(world.overrides[name], DEFAULTS) for name in names}
    choice = choose(ranked, names[0], [one.evidence for one in chosen if one.evidence], distances, settings)
    mended = _mended_set(world, flights, names)
    if mended is not None:
        # No set of the study has a mended delay and another change.
        alone = Choice("keep", mended, None, None, choice.exploratory, None)
        choice = choose_after_mending(choice, ranked, alone, mended)
    return world.sets.index(choice.chosen), ranked


def _mended_set(world: World, flights: Sequence[int], names: Sequence[str]) -> str | None:
    """The set that does nothing but mend the delays that these flights prove wrong, as the product would add it."""
    told = {str(number): world.delays[index] for number, index in enumerate(flights)}
    wanted = mended_values(join_delays(told, None, DelaySettings()))
    if not wanted:
        return None
    return next((name for name in names if _mends(world.overrides[name], wanted)), None)


def _mends(overrides: Mapping[str, float], wanted: Mapping[str, float]) -> bool:
    return overrides.keys() == wanted.keys() and all(
        abs(overrides[name] - value) <= STEP_MS for name, value in wanted.items()
    )


def _named(flight: AnalyzedFlight, name: str) -> AnalyzedFlight:
    evidence = flight.evidence
    return replace(flight, name=name, evidence=evidence and replace(evidence, flight=name))
