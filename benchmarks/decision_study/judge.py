"""The judge knows the truth: regret of what the rules choose, how often they choose the best, and calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fusetune.apply.settings import DecisionSettings

from .rules import OURS, Rule, decide, rules
from .world import TRUTH, World, scores

PROCESS = frozenset({"EKF2_ACC_NOISE", "EKF2_GYR_NOISE", "EKF2_ACC_B_NOISE", "EKF2_GYR_B_NOISE"})
ALLOWED_REGRET = 0.05


@dataclass(frozen=True)
class Verdict:
    """What one rule chose from one study, judged by the truth.

    Attributes
    ----------
    regret : per true figure, by how much larger the error of the chosen set is than the best set's (0.05 is 5 %)
    on_front : no other set of the study is better in one true figure and as good in all
    worst_in : true figures in which it is the worst set of the study
    """

    world: str
    study: str
    rule: str
    chosen: str
    regret: dict[str, float]
    on_front: bool
    worst_in: tuple[str, ...]

    @property
    def passes(self) -> bool:
        """Near the best in every figure, or at least beaten by no set in all."""
        return max(self.regret.values()) <= ALLOWED_REGRET or self.on_front


def studies(world: World) -> dict[str, list[int]]:
    """Sets that vary only process noise, only measurement noise, and all; the present set is in each."""
    kinds: dict[str, list[int]] = {"process noise": [0], "measurement noise": [0], "both": list(range(len(world.sets)))}
    for index, name in enumerate(world.sets[1:], 1):
        varied = set(world.overrides[name])
        if varied <= PROCESS:
            kinds["process noise"].append(index)
        elif not varied & PROCESS:
            kinds["measurement noise"].append(index)
    return kinds


def judge(world: World, study: str, sets: Sequence[int], rule: str, chosen: int) -> Verdict:
    """Judge one choice by the mean true errors over all flights of the world."""
    errors = np.array([world.true_error(quantity)[list(sets)] for quantity in TRUTH])
    place = list(sets).index(chosen)
    regret = errors[:, place] / errors.min(axis=1) - 1.0
    beaten = [
        (errors[:, other] <= errors[:, place]).all() and (errors[:, other] < errors[:, place]).any()
        for other in range(len(sets))
    ]
    worst = tuple(name for name, row in zip(TRUTH, errors, strict=True) if row[place] == row.max() > row.min())
    return Verdict(
        world.name,
        study,
        rule,
        world.sets[chosen],
        dict(zip(TRUTH, regret.tolist(), strict=True)),
        not any(beaten),
        worst,
    )


def judge_all(worlds: Sequence[World], flights: int, settings: DecisionSettings) -> list[Verdict]:
    """Every rule on every study of every world, from the first flights."""
    return [
        judge(world, study, sets, name, rule(world, range(flights), sets))
        for world in worlds
        for study, sets in studies(world).items()
        for name, rule in rules(settings).items()
    ]


@dataclass(frozen=True)
class Resampled:
    """One rule over many draws of flights: how often the choice passed, was the best set, and its mean worst regret."""

    rule: str
    passed: float
    best: float
    regret: float
    ever_worst: float


def resample(
    worlds: Sequence[World], flights: int, draws: int, settings: DecisionSettings, generator: np.random.Generator
) -> list[Resampled]:
    """Draw flights without replacement again and again, and judge what each rule chooses from them.

    The best set is the one with the lowest mean regret over the four true figures.
    """
    found: dict[str, list[tuple[bool, bool, float, bool]]] = {}
    for world in worlds:
        for study, sets in studies(world).items():
            everyone = {index: judge(world, study, sets, "", index) for index in sets}
            mean = {index: np.mean(list(one.regret.values())) for index, one in everyone.items()}
            best = min(mean, key=lambda index: mean[index])
            for _ in range(draws):
                drawn = generator.choice(len(world.flights), flights, replace=False)
                for name, rule in rules(settings).items():
                    chosen = rule(world, drawn, sets)
                    one = everyone[chosen]
                    row = (one.passes, chosen == best, max(one.regret.values()), len(one.worst_in) == len(TRUTH))
                    found.setdefault(name, []).append(row)
    return [Resampled(name, *map(float, np.mean(rows, axis=0))) for name, rows in found.items()]


def coverage(
    worlds: Sequence[World], flights: int, draws: int, settings: DecisionSettings, generator: np.random.Generator
) -> dict[str, float]:
    """Share of intervals that hold the true mean difference to the present set, per world.

    The world is what its flights are drawn from, with replacement, so the truth is their mean.
    """
    shares = {}
    for world in worlds:
        true = scores(world.flights, world.sets).mean(axis=0)
        true = true - true[0]
        inside = []
        for _ in range(draws):
            drawn = generator.integers(0, len(world.flights), flights)
            _, ranked = decide(world, drawn, range(len(world.sets)), settings)
            for one in ranked:
                if one.name != world.sets[0] and one.lower is not None and one.upper is not None:
                    inside.append(one.lower <= true[world.sets.index(one.name)] <= one.upper)
        shares[world.name] = float(np.mean(inside))
    return shares


def false_changes(
    worlds: Sequence[World], flights: int, draws: int, settings: DecisionSettings, generator: np.random.Generator
) -> dict[str, float]:
    """Share of studies in which a change is recommended although all sets are equal.

    On every flight the names are dealt out anew among the sets, so no name is better than another but by chance.
    """
    shares = {}
    for world in worlds:
        changed = 0
        for _ in range(draws):
            drawn = generator.choice(len(world.flights), flights, replace=False)
            dealt = replace(
                world,
                flights=tuple(_dealt_out(flight, generator) for flight in world.flights),
                vetoed={},
            )
            chosen, _ = decide(dealt, drawn, range(len(world.sets)), settings)
            changed += chosen != 0
        shares[world.name] = changed / draws
    return shares


def changes_among_twins(
    worlds: Sequence[World], flights: int, draws: int, settings: DecisionSettings, generator: np.random.Generator
) -> dict[str, float]:
    """Share of studies in which a change is recommended among sets that are one and the same under different names."""
    shares = {}
    for world in worlds:
        twins = replace(world, flights=tuple(_as_twins(flight) for flight in world.flights), vetoed={})
        chosen = [
            decide(
                twins, generator.choice(len(world.flights), flights, replace=False), range(len(world.sets)), settings
            )[0]
            for _ in range(draws)
        ]
        shares[world.name] = float(np.mean(np.array(chosen) != 0))
    return shares


def _as_twins(flight):  # type: ignore[no-untyped-def]
    evidence = flight.evidence
    aims = tuple(
        replace(
            aim,
            sum_nis=np.repeat(aim.sum_nis[:1], len(evidence.sets), axis=0),
            sum_log_variance=np.repeat(aim.sum_log_variance[:1], len(evidence.sets), axis=0),
        )
        for aim in evidence.aims
    )
    return replace(flight, evidence=replace(evidence, aims=aims))


def _dealt_out(flight, generator: np.random.Generator):  # type: ignore[no-untyped-def]
    names = list(flight.evidence.sets)
    order = generator.permutation(len(names))
    return replace(flight, evidence=replace(flight.evidence, sets=tuple(names[index] for index in order)))


def failures(verdicts: Sequence[Verdict], rule: str = OURS) -> list[Verdict]:
    """Verdicts of a rule that do not pass."""
    return [one for one in verdicts if one.rule == rule and not one.passes]


def by_rule(verdicts: Sequence[Verdict]) -> Mapping[str, list[Verdict]]:
    """Verdicts of each rule, in the order of the studies."""
    grouped: dict[str, list[Verdict]] = {}
    for one in verdicts:
        grouped.setdefault(one.rule, []).append(one)
    return grouped


__all__ = [
    "Resampled",
    "Rule",
    "Verdict",
    "by_rule",
    "changes_among_twins",
    "coverage",
    "failures",
    "false_changes",
    "judge",
    "judge_all",
    "resample",
    "studies",
]
