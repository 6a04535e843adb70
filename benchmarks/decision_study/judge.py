"""The judge knows the truth: what the choice of a rule costs, and whether the rule passes with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fusetune.apply.settings import DecisionSettings

from .rules import OURS, Rule, rules
from .world import World

PROCESS = frozenset({"EKF2_ACC_NOISE", "EKF2_GYR_NOISE", "EKF2_ACC_B_NOISE", "EKF2_GYR_B_NOISE"})
ALLOWED_REGRET, ALLOWED_HARM = 0.05, 0.05
BETTER, HARDLY_WORSE = 0.05, 0.02
"""Another set beats the chosen one if it is better by so much in one true figure and worse by no more in any."""


@dataclass(frozen=True)
class Verdict:
    """What one rule chose from one study, judged by the truth.

    Attributes
    ----------
    regret : per true figure, by how much larger the error of the chosen set is than the best set's (0.05 is 5 %)
    beaten_by : sets that are better by `BETTER` in one true figure and not worse by more than `HARDLY_WORSE` in any
    harm : true figures in which the choice is worse than the present set by more than `ALLOWED_HARM`, and by how much
    worst_in : true figures in which it is the worst set of the study
    is_worst : it is the worst in the mean of the logarithms of the four
    on_old_front : no other set is as good in all four and better in one, which was the measure of the first study
    """

    world: str
    study: str
    rule: str
    chosen: str
    regret: dict[str, float]
    beaten_by: tuple[str, ...]
    harm: dict[str, float]
    worst_in: tuple[str, ...]
    is_worst: bool
    on_old_front: bool

    @property
    def is_near(self) -> bool:
        """Near the best in every figure."""
        return max(self.regret.values()) <= ALLOWED_REGRET

    @property
    def passes(self) -> bool:
        """Near the best in every figure, or beaten by no set; and not the worst."""
        return self.is_near or (not self.beaten_by and not self.is_worst)

    @property
    def passes_as_before(self) -> bool:
        """The measure of the first study."""
        return self.is_near or self.on_old_front


def studies(world: World) -> dict[str, list[int]]:
    """Sets that vary only process noise, only what is told of measurements, and all; the present set is in each."""
    kinds: dict[str, list[int]] = {"process noise": [0], "measurement noise": [0], "both": list(range(len(world.sets)))}
    for index, name in enumerate(world.sets[1:], 1):
        varied = set(world.overrides[name])
        if varied <= PROCESS:
            kinds["process noise"].append(index)
        elif not varied & PROCESS:
            kinds["measurement noise"].append(index)
    return kinds


def judge(world: World, study: str, sets: Sequence[int], rule: str, chosen: int) -> Verdict:
    """Judge one choice by the mean true errors over all flights of the world; the first of the sets is the present."""
    errors = world.true_errors[:, list(sets)]
    place = list(sets).index(chosen)
    own = errors[:, [place]]
    beats = (errors * (1.0 + BETTER) <= own).any(axis=0) & (errors <= own * (1.0 + HARDLY_WORSE)).all(axis=0)
    dominates = (errors <= own).all(axis=0) & (errors < own).any(axis=0)
    harm = own[:, 0] / errors[:, 0] - 1.0
    mean = np.log(errors).mean(axis=0)
    return Verdict(
        world.name,
        study,
        rule,
        world.sets[chosen],
        dict(zip(world.quantities, (own[:, 0] / errors.min(axis=1) - 1.0).tolist(), strict=True)),
        tuple(world.sets[sets[other]] for other in np.flatnonzero(beats)),
        {name: float(one) for name, one in zip(world.quantities, harm, strict=True) if one > ALLOWED_HARM},
        tuple(name for name, row in zip(world.quantities, errors, strict=True) if row[place] == row.max() > row.min()),
        bool(mean[place] == mean.max() > mean.min()),
        not dominates.any(),
    )


def judge_world(world: World, flights: int, settings: DecisionSettings) -> list[Verdict]:
    """Every rule on every study of a world, from its first flights."""
    known = world.first(flights)
    return [
        judge(world, study, sets, name, rule(known, range(flights), sets))
        for study, sets in studies(world).items()
        for name, rule in rules(settings).items()
    ]


def gains(world: World, sets: Sequence[int]) -> dict[str, np.ndarray]:
    """(S,) by how much smaller the true errors are than the present set's, in velocity and in the mean of the four.

    The mean is that of the logarithms of the ratios.
    """
    logs = np.log(world.true_errors[:, list(sets)])
    logs = logs - logs[:, :1]
    return {"velocity": 1.0 - np.exp(logs[0]), "all four": 1.0 - np.exp(logs.mean(axis=0))}


def failures(verdicts: Sequence[Verdict], rule: str = OURS) -> list[Verdict]:
    """Verdicts of a rule that do not pass."""
    return [one for one in verdicts if one.rule == rule and not one.passes]


def by_rule(verdicts: Sequence[Verdict]) -> Mapping[str, list[Verdict]]:
    """Verdicts of each rule, in the order of the studies."""
    grouped: dict[str, list[Verdict]] = {}
    for one in verdicts:
        grouped.setdefault(one.rule, []).append(one)
    return grouped


__all__ = ["Rule", "Verdict", "by_rule", "failures", "gains", "judge", "judge_world", "studies"]
