"""Delay and place of a sensor of velocity from several flights of one vehicle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.delays.velocity_place import VelocityPlace
from fusetune.analyze.metrics.random_effects import random_effects

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PooledPlace:
    """Joined over the flights.

    Attributes
    ----------
    delay_s, delay_error_s : delay and its standard error
    arm, arm_error : (3,) m, and standard errors
    flights : how many told anything
    """

    delay_s: float
    delay_error_s: float
    arm: Array
    arm_error: Array
    flights: int


def pooled_place(places: Sequence[VelocityPlace | None]) -> PooledPlace | None:
    """Pool what flights tell; None where none tells anything.

    Delay and axes are random effects each, as `analyze/effects/pooled` has the same antenna: what flights differ by
    beyond their errors counts. The axes' errors hardly go together (correlations of 0.03 in the median).
    """
    told = [one for one in places if one is not None]
    if not told:
        return None
    delay = random_effects([one.lag.delay_s for one in told], [one.lag.standard_error_s for one in told])
    errors = np.sqrt([np.diag(one.arm_covariance) for one in told])
    axes = [random_effects([one.arm[axis] for one in told], errors[:, axis]) for axis in range(3)]
    return PooledPlace(
        delay.mean,
        delay.standard_error,
        np.array([one.mean for one in axes]),
        np.array([one.standard_error for one in axes]),
        len(told),
    )
