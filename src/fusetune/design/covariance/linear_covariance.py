"""The covariance recursion of a linear model, with sensors of any rate, at any time, however late.

A late measurement tells of a state that is past when it arrives. So when it is made, H x is kept beside the state
(stochastic cloning: Roumeliotis and Burdick, ICRA 2002), and when it arrives, that copy is what is corrected; the
correlation with the state does the rest. This is the optimum that out-of-sequence updates reach, too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm

from fusetune.design.covariance.linear_model import LinearModel, LinearSensor
from fusetune.design.covariance.riccati_map import RiccatiMap

Array = npt.NDArray[np.float64]

TICKS_PER_S = 10**9
"""Times are whole nanoseconds, so that what is meant to happen together does."""
LARGEST_DENOMINATOR = 1000
"""Of a period in seconds per hertz: 3.125 Hz is one, an irrational rate is none."""
MOST_EVENTS = 200_000
_AT_ONCE = {"step": 0, "measure": 1, "arrive": 2}
"""Order of what happens at one instant: the state moves on, is measured, and a measurement arrives."""


class NoSteadyStateError(ValueError):
    """Some of the covariance grows without end."""


class NoCommonPeriodError(ValueError):
    """The sensors' times hardly ever repeat."""


@dataclass(frozen=True)
class _Event:
    at: Fraction | int
    kind: str
    sensor: str = ""


@dataclass(frozen=True)
class Recursion:
    """What happens in one period of all sensors, as maps of the covariance of the state and the copies beside it.

    Attributes
    ----------
    n : number of states, which come first
    period_s : after which everything repeats
    maps : in order; `before[i]` says which sensor's measurement arrives in map i, empty for none
    """

    n: int
    period_s: float
    maps: tuple[RiccatiMap, ...]
    before: tuple[str, ...]

    def whole(self) -> RiccatiMap:
        """One period as one map."""
        return _joined(self.maps)

    def just_before(self, P: Array, sensor: str) -> Array:
        """Mean over the corrections by a sensor of P just before each, (n, n), in the period that begins with P.

        Where other measurements arrive at the same instant, it is before all of them.
        """
        found, uncorrected = [], P
        for step, arrives in zip(self.maps, self.before, strict=True):
            if not arrives:
                P = uncorrected = step(P)
                continue
            if arrives == sensor:
                found.append(uncorrected[: self.n, : self.n])
            P = step(P)
        return np.asarray(np.mean(found, axis=0))


def covariance_before_correction(model: LinearModel, sensor: str, duration_s: float | None = None) -> Array:
    """P just before the corrections by a sensor, (n, n).

    Parameters
    ----------
    duration_s : from P0 on, in whole periods of all sensors; None for the steady state

    Raises
    ------
    NoSteadyStateError
        There is none.
    NoCommonPeriodError
        It takes too long until the sensors' times repeat.
    """
    recursion = recursion_of(model)
    whole = recursion.whole()
    if duration_s is not None:
        P = np.zeros_like(whole.Q)
        P[: recursion.n, : recursion.n] = model.P0
        periods = max(round(duration_s / recursion.period_s) - 1, 0)
        P = whole.repeated(periods)(P) if periods else P
    else:
        steady = whole.steady_state()
        if steady is None:
            raise NoSteadyStateError("some of the covariance grows without end")
        P = steady
    return recursion.just_before(P, sensor)


def recursion_of(model: LinearModel) -> Recursion:
    """The maps of one period of a model's sensors, all of which have been measuring for long."""
    sensors = model.sensors_on
    period = _common_period([Fraction(1) / _rate(sensor.rate_hz) for sensor in sensors.values()], model)
    slots = _slots(sensors)
    size = len(model.states) + sum(depth * len(sensors[name].H) for name, depth in slots.items())
    layout = _Layout(model, slots, size)
    maps: list[RiccatiMap] = []
    before: list[str] = []
    now: Fraction = Fraction(0)
    for event in _events(model, period):
        if event.at > now:
            maps.append(layout.move(float(event.at - now)))
            before.append("")
            now = Fraction(event.at)
        if event.kind == "measure":
            maps.append(layout.keep_copy(event.sensor))
            before.append("")
        elif event.kind == "arrive":
            maps.append(layout.correct(event.sensor))
            before.append(event.sensor)
    return Recursion(len(model.states), float(period), tuple(maps), tuple(before))


def _events(model: LinearModel, period: Fraction) -> Iterator[_Event]:
    """What happens after 0 up to and at the end of the period, in order; the first measurements are at their phases."""
    each_second = model.step_rate_hz + 2.0 * sum(sensor.rate_hz for sensor in model.sensors_on.values())
    if float(period) * each_second > MOST_EVENTS:
        raise NoCommonPeriodError(f"the sensors' times repeat only after {float(period):g} s")
    found: list[_Event] = []
    step = Fraction(1) / _rate(model.step_rate_hz)
    found += [_Event((k + 1) * step, "step") for k in range(math.ceil(period / step))]
    for name, sensor in model.sensors_on.items():
        every = Fraction(1) / _rate(sensor.rate_hz)
        count = int(period / every)
        delay, phase = _time(sensor.delay_s), _time(sensor.phase_s)
        if delay:
            found += [_Event(_within(phase + k * every, period), "measure", name) for k in range(count)]
        found += [_Event(_within(phase + k * every + delay, period), "arrive", name) for k in range(count)]
    found = [event for event in found if event.at < period] + [_Event(period, "step")] + [
        event for event in found if event.at == period and event.kind != "step"
    ]  # fmt: skip
    yield from sorted(found, key=lambda event: (event.at, _AT_ONCE[event.kind]))


def _within(at: Fraction, period: Fraction) -> Fraction:
    """The same time in the period (0, period]."""
    at = at % period
    return at if at else period


def _rate(rate_hz: float) -> Fraction:
    return Fraction(rate_hz).limit_denominator(LARGEST_DENOMINATOR)


def _time(time_s: float) -> Fraction:
    return Fraction(round(time_s * TICKS_PER_S), TICKS_PER_S)


def _common_period(periods: Sequence[Fraction], model: LinearModel) -> Fraction:
    """Least common multiple; of a discrete model that of its step, too."""
    parts = [*periods, *([Fraction(1) / _rate(model.step_rate_hz)] if model.is_discrete or not periods else [])]
    numerator = math.lcm(*(part.numerator for part in parts))
    return Fraction(numerator, math.gcd(*(part.denominator for part in parts)))


def _slots(sensors: dict[str, LinearSensor]) -> dict[str, int]:
    """How many measurements of each late sensor are under way at once, with the one that arrives."""
    return {
        name: math.floor(_time(sensor.delay_s) * _rate(sensor.rate_hz)) + 1
        for name, sensor in sensors.items()
        if _time(sensor.delay_s)
    }


class _Layout:
    """Where state and copies sit; a sensor's copies follow each other, the newest first."""

    def __init__(self, model: LinearModel, slots: dict[str, int], size: int) -> None:
        self.model, self.slots, self.size, self.n = model, slots, size, len(model.states)
        self.first: dict[str, int] = {}
        place = self.n
        for name, depth in slots.items():
            self.first[name] = place
            place += depth * len(model.sensors[name].H)
        self._moves: dict[float, RiccatiMap] = {}

    def move(self, step_s: float) -> RiccatiMap:
        """The state moves on, the copies stay."""
        key = round(step_s, 12)
        if key not in self._moves:
            A, Q = np.eye(self.size), np.zeros((self.size, self.size))
            A[: self.n, : self.n], Q[: self.n, : self.n] = transition(self.model, step_s)
            self._moves[key] = RiccatiMap.propagation(A, Q)
        return self._moves[key]

    def keep_copy(self, name: str) -> RiccatiMap:
        """The copies of a sensor move up by one, and H x takes the first place."""
        H = self.model.sensors[name].H
        rows, first, depth = len(H), self.first[name], self.slots[name]
        A = np.eye(self.size)
        A[first : first + depth * rows] = 0.0
        A[first : first + rows, : self.n] = H
        for row in range((depth - 1) * rows):
            A[first + rows + row, first + row] = 1.0
        return RiccatiMap.propagation(A, np.zeros((self.size, self.size)))

    def correct(self, name: str) -> RiccatiMap:
        """The oldest copy of a sensor, or the state itself where it has no delay, is told by its measurement."""
        sensor = self.model.sensors[name]
        H = np.zeros((len(sensor.H), self.size))
        if name in self.slots:
            last = self.first[name] + (self.slots[name] - 1) * len(H)
            H[:, last : last + len(H)] = np.eye(len(H))
        else:
            H[:, : self.n] = sensor.H
        return RiccatiMap.correction(H, sensor.R)


def transition(model: LinearModel, step_s: float) -> tuple[Array, Array]:
    """Transition and noise covariance of a step, each (n, n)."""
    if model.is_discrete:
        return model.A, model.Q
    if not model.is_exact:
        return np.eye(len(model.A)) + model.A * step_s, model.Q * step_s
    n = len(model.A)
    block = np.block([[-model.A, model.Q], [np.zeros((n, n)), model.A.T]])
    stepped = expm(block * step_s)
    A = stepped[n:, n:].T
    Q = A @ stepped[:n, n:]
    return A, 0.5 * (Q + Q.T)


def _joined(maps: Sequence[RiccatiMap]) -> RiccatiMap:
    whole = maps[0]
    for one in maps[1:]:
        whole = whole.then(one)
    return whole
