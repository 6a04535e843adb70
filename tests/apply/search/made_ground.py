"""A ground whose answers are known: the score of a set is a bowl around a best point, the same on all flights but for
what chance adds to each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from fusetune.analyze.delays.lag import Lag
from fusetune.analyze.delays.velocity_place import VelocityPlace
from fusetune.apply.evidence import AIMS
from fusetune.apply.search.comparison import Comparison
from fusetune.apply.search.requests import Ask, Values
from fusetune.apply.search.space import Space
from fusetune.design.factors import factors_around

PRESENT = {"EKF2_GPS_DELAY": 110.0, "EKF2_GPS_V_NOISE": 0.3, "EKF2_ACC_NOISE": 0.35, "EKF2_MAG_NOISE": 0.05}
SPACE = Space(factors_around(PRESENT, tuple(PRESENT)))


@dataclass
class MadeGround:
    """Scores ½ Σ wᵢ (uᵢ − bᵢ)² over the points u of the space, less that of the base.

    Attributes
    ----------
    best : the set of the lowest score, name → value
    weights : of its parameters; those of others are 0
    spread : standard deviation of what chance adds to the best point of each flight
    asked : flights and asks, in their order
    """

    best: dict[str, float]
    weights: dict[str, float]
    spread: float = 0.0
    space: Space = SPACE
    asked: list[tuple[tuple[str, ...], Ask]] = field(default_factory=list)

    def compare(self, asks: Sequence[tuple[Sequence[str], Ask]]) -> list[Comparison]:
        self.asked += [(tuple(flights), ask) for flights, ask in asks]
        return [self._compared(flights, ask) for flights, ask in asks]

    def _compared(self, flights: Sequence[str], ask: Ask) -> Comparison:
        rows = [[self._score(flight, one) - self._score(flight, ask.base) for flight in flights] for one in ask.sets]
        differences = np.array(rows).reshape(len(ask.sets), len(flights))
        aims = {aim: np.full(differences.shape, np.nan) for aim in AIMS}
        return Comparison(differences, aims, ((),) * len(ask.sets), (self._place,) * len(flights))

    @property
    def _place(self) -> VelocityPlace | None:
        """Every flight tells the best delay, and that the antenna is where it is told."""
        lag = Lag(1e-3 * self.best["EKF2_GPS_DELAY"], 2e-3, 1000, 300)
        return VelocityPlace(lag, np.zeros(3), 1e-4 * np.eye(3))

    def _score(self, flight: str, values: Values) -> float:
        weights = np.array([self.weights.get(name, 0.0) for name in self.space.parameters])
        chance = np.random.default_rng(int(flight)).normal(0.0, self.spread, weights.size)
        off = self.space.point(dict(values)) - self.space.point(self.best) - chance
        return float(0.5 * np.sum(weights * np.square(off)))
