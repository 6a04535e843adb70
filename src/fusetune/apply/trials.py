"""Sets that were tried on flights: what each changes, and how it does there against the present set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.design.factors import Factor

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Trials:
    """N sets over P factors, on F flights.

    Attributes
    ----------
    factors : what is varied, each with the present value as its origin
    names : (N,) of the sets
    values : (N, P) values of the factors; parameters that a set leaves alone have the present value
    flights : (F,) names
    differences : (N, F) score less that of the present set, nat; lower is better; NaN where a set was not tried or has
        no score
    aims : the same in each kind of prediction (`fusetune.apply.evidence.AIMS`)
    allowed : (N, F) false where something other than the score speaks against the set on the flight
    """

    factors: tuple[Factor, ...]
    names: tuple[str, ...]
    values: Array
    flights: tuple[str, ...]
    differences: Array
    aims: Mapping[str, Array]
    allowed: npt.NDArray[np.bool_]

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the factors."""
        return tuple(factor.parameter for factor in self.factors)

    @property
    def coordinates(self) -> Array:
        """(N, P) of the values."""
        rows = [
            [factor.coordinate(value) for factor, value in zip(self.factors, row, strict=True)] for row in self.values
        ]
        return np.array(rows, dtype=np.float64).reshape(len(self.names), len(self.factors))

    def on_flights(self, flights: Sequence[str]) -> Trials:
        """The same, on some of the flights."""
        columns = [self.flights.index(name) for name in flights]
        aims = {aim: values[:, columns] for aim, values in self.aims.items()}
        return Trials(
            self.factors, self.names, self.values, tuple(flights), self.differences[:, columns], aims,
            self.allowed[:, columns],
        )  # fmt: skip
