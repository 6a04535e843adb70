"""Studies drawn again and again from the flights of a world: how often a rule passes, and finds what is to be found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fusetune.apply.settings import DecisionSettings

from .judge import gains, judge, studies
from .rules import OLD, OURS, rules
from .world import World

SIZES = (3, 4, 5, 6, 8, 10, 12)
JUDGED_SIZES = (5, 8)
"""For these all rules are drawn, for the others the decision and the one before it."""


@dataclass(frozen=True)
class DrawnStudy:
    """What one rule chose from drawn flights.

    Attributes
    ----------
    passed, is_best, worst_regret, is_worst : as in `Verdict`; the best set has the lowest mean regret
    harms : the change makes a true figure worse by more than is allowed
    possible : true gain of the best set that is not vetoed, by the two measures of `judge.gains`
    gained : true gain of the chosen set
    """

    world: str
    study: str
    rule: str
    flights: int
    passed: bool
    is_best: bool
    worst_regret: float
    is_worst: bool
    harms: bool
    possible: dict[str, float]
    gained: dict[str, float]

    def has_found(self, gain: float, measure: str) -> bool:
        """The chosen set gains at least so much."""
        return self.gained[measure] >= gain


def draw_studies(
    world: World, draws: int, settings: DecisionSettings, generator: np.random.Generator
) -> list[DrawnStudy]:
    """Draw flights without replacement, `draws` times for each kind of study and number of flights."""
    found = []
    everything = rules(settings)
    for study, sets in studies(world).items():
        everyone = {index: judge(world, study, sets, "", index) for index in sets}
        mean = {index: float(np.mean(list(one.regret.values()))) for index, one in everyone.items()}
        best = min(mean, key=lambda index: mean[index])
        gain = gains(world, sets)
        able = [place for place, index in enumerate(sets) if world.sets[index] not in world.vetoed]
        possible = {measure: float(values[able].max()) for measure, values in gain.items()}
        for flights in (size for size in SIZES if size <= len(world.flights)):
            names = everything if flights in JUDGED_SIZES else (OLD, OURS)
            for _ in range(draws):
                drawn = generator.choice(len(world.flights), flights, replace=False)
                for name in names:
                    chosen = everything[name](world, drawn.tolist(), sets)
                    one = everyone[chosen]
                    place = sets.index(chosen)
                    found.append(
                        DrawnStudy(
                            world.name,
                            study,
                            name,
                            flights,
                            one.passes,
                            chosen == best,
                            max(one.regret.values()),
                            one.is_worst,
                            bool(one.harm),
                            possible,
                            {measure: float(values[place]) for measure, values in gain.items()},
                        )
                    )
    return found


def power(drawn: Sequence[DrawnStudy], flights: int, gain: float, measure: str) -> tuple[float, int]:
    """Share of the studies in which so much can be gained that gain it, and how many studies these are."""
    able = [one for one in drawn if one.flights == flights and one.possible[measure] >= gain]
    return (float(np.mean([one.has_found(gain, measure) for one in able])) if able else float("nan")), len(able)
