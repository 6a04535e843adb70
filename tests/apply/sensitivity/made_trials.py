"""Trials of worlds whose score is a known function of the coordinates."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from fusetune.apply.evidence import AIMS
from fusetune.apply.trials import Trials
from fusetune.design.factors import Factor

Array = npt.NDArray[np.float64]

NAMES = ("EKF2_GPS_V_NOISE", "EKF2_ACC_NOISE", "EKF2_BARO_NOISE", "EKF2_MAG_NOISE")
"""Parameters of the made worlds, in order; each has the present value 0.3 and a factor of 8 to either side."""


def made_factors(count: int) -> tuple[Factor, ...]:
    return tuple(Factor(name, "log", 0.3 / 8.0, 0.3 * 8.0, 0.3, 2.0) for name in NAMES[:count])


def drawn(sets: int, factors: int, reach: float = 3.0, seed: int = 1) -> Array:
    """(N, P) coordinates, uniform within the reach."""
    return np.random.default_rng(seed).uniform(-reach, reach, (sets, factors))


def made_trials(coordinates: Array, scores: Sequence[Callable[[Array], Array]]) -> Trials:
    """Sets at coordinates (N, P), with the score difference of each flight as a function of these."""
    factors = made_factors(coordinates.shape[1])
    values = np.array([[one.origin * 2.0**at for one, at in zip(factors, row, strict=True)] for row in coordinates])
    differences = np.column_stack([score(coordinates) for score in scores])
    return Trials(
        factors,
        tuple(f"set{index}" for index in range(len(values))),
        values,
        tuple(f"flight{index}" for index in range(len(scores))),
        differences,
        dict.fromkeys(AIMS, differences),
        np.ones(differences.shape, dtype=bool),
    )
