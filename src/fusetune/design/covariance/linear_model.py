"""Linear models: what moves, what shakes it, and what is measured of it when."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class State:
    """A state: its name and unit."""

    name: str
    unit: str = ""


@dataclass(frozen=True)
class LinearSensor:
    """A sensor that measures y = H x + v, with v white.

    Attributes
    ----------
    H : (m, n)
    R : (m, m) covariance of v, which must be regular
    rate_hz : of its samples
    delay_s : from the measurement to its arrival
    phase_s : of the first measurement
    on : whether it is used
    """

    H: Array
    R: Array
    rate_hz: float
    delay_s: float = 0.0
    phase_s: float = 0.0
    on: bool = True


@dataclass(frozen=True)
class LinearModel:
    """A linear system with white process noise.

    Attributes
    ----------
    states : n of them
    A : (n, n) of dx/dt = A x + noise where `is_discrete` is false, else the transition over one step
    is_discrete : what `A` is
    is_exact : whether a step of h is taken with exp(A h) and the integral of the noise over it (Van Loan, IEEE
        Transactions on Automatic Control 23, 1978), not with I + A h and Q h; of a discrete model without meaning
    step_rate_hz : steps of the propagation per second
    noises : by name, (n, n) intensities per second of white noises, or of a discrete model covariances per step
    sensors : by name
    P0 : (n, n) covariance at the start
    """

    states: tuple[State, ...]
    A: Array
    step_rate_hz: float
    noises: Mapping[str, Array]
    sensors: Mapping[str, LinearSensor]
    P0: Array
    is_discrete: bool = False
    is_exact: bool = False

    @property
    def Q(self) -> Array:
        """(n, n) sum of the noises."""
        return np.asarray(sum(self.noises.values(), np.zeros_like(self.A)))

    @property
    def sensors_on(self) -> dict[str, LinearSensor]:
        """Those that are used."""
        return {name: sensor for name, sensor in self.sensors.items() if sensor.on}
