"""Delay and place of a sensor of velocity from several flights of one vehicle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.delays.velocity_place import VelocityPlace

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PooledPlace:
    """Weighted by what each flight tells.

    Attributes
    ----------
    delay_s, delay_error_s : delay and its standard error
    arm, arm_covariance : (3,) m and (3, 3) m²
    flights : how many told anything
    """

    delay_s: float
    delay_error_s: float
    arm: Array
    arm_covariance: Array
    flights: int

    @property
    def arm_error(self) -> Array:
        """(3,) standard errors, m."""
        return np.asarray(np.sqrt(np.diag(self.arm_covariance)))


def pooled_place(places: Sequence[VelocityPlace | None]) -> PooledPlace | None:
    """Pool what flights tell; None where none tells anything.

    Where flights differ by more than their errors, the errors are so much larger (the ratio of Birge, 1932).
    """
    told = [one for one in places if one is not None]
    if not told:
        return None
    delays = [(np.array([one.lag.delay_s]), np.array([[one.lag.standard_error_s**2]])) for one in told]
    delay, variance = _pooled(delays)
    arm, covariance = _pooled([(one.arm, one.arm_covariance) for one in told])
    return PooledPlace(float(delay[0]), math.sqrt(variance[0, 0]), arm, covariance, len(told))


def _pooled(told: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    weights = [np.linalg.inv(covariance) for _, covariance in told]
    covariance = np.linalg.inv(np.sum(weights, axis=0))
    mean = covariance @ np.sum([weight @ value for weight, (value, _) in zip(weights, told, strict=True)], axis=0)
    freedom = mean.size * (len(told) - 1)
    off = [value - mean for value, _ in told]
    apart = sum(float(one @ weight @ one) for weight, one in zip(weights, off, strict=True))
    return mean, covariance * max(1.0, apart / freedom if freedom else 1.0)
