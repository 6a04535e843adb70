"""A design evaluated: what it is, each variation of it, what pays most per sensor, and curves.

A design of either kind is a `Design`; what differs between them is how a covariance comes about.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from fusetune.design.covariance.changes import Sweep, Value, Variation
from fusetune.errors import UserError

BASELINE = "as designed"


@dataclass(frozen=True)
class Deviation:
    """Standard deviation of a state.

    Attributes
    ----------
    before : just before a correction; along a track its root mean square
    largest : along a track the largest
    now : along a track at the time of flight, which is later than what is corrected by the longest delay
    """

    unit: str
    before: float
    largest: float | None = None
    now: float | None = None

    @property
    def judged(self) -> float:
        """That of the present where it is told, for a delay shows there alone; else that before a correction."""
        return self.before if self.now is None else self.now


Deviations = Mapping[str, Deviation]
"""By name of the state."""


@dataclass(frozen=True)
class Alternative:
    """One property of one sensor, better or worse than designed; of its presence, to do without it."""

    sensor: str
    subject: str
    what: str
    changes: Mapping[str, Value]

    @property
    def name(self) -> str:
        """What it is called in tables and figures."""
        return f"{self.sensor}: {self.subject} {self.what}" if self.what else f"{self.subject} {self.sensor}"


NOISE, RATE, DELAY, WITHOUT = "noise", "rate", "delay", "without"
BETTER = {NOISE: "÷2", RATE: "×2", DELAY: "÷2"}
WORSE = {NOISE: "×2", RATE: "÷2", DELAY: "×2"}
_CHANGED = {NOISE: "sd", RATE: "rate_hz", DELAY: "delay_ms"}


def alternatives(sensor: str, subjects: Sequence[str]) -> Iterator[Alternative]:
    """A sensor's properties, each better and worse, and to do without it."""
    for subject in subjects:
        if subject == WITHOUT:
            yield Alternative(sensor, WITHOUT, "", {f"{sensor}.used": False})
            continue
        for factors in (BETTER, WORSE):
            yield Alternative(sensor, subject, factors[subject], {f"{sensor}.{_CHANGED[subject]}": factors[subject]})


class Design(Protocol):
    """A sensing system of which covariances can be told."""

    @property
    def name(self) -> str:
        """What it is called; a folder's name."""
        ...

    @property
    def judged(self) -> tuple[str, ...]:
        """States by which improvements are judged."""
        ...

    @property
    def variations(self) -> tuple[Variation, ...]:
        """What its file asks for."""
        ...

    @property
    def sweeps(self) -> tuple[Sweep, ...]:
        """Curves that its file asks for."""
        ...

    def alternatives(self) -> Iterator[Alternative]:
        """For each sensor and noise what could be better and worse about it, and to do without."""
        ...

    def deviations(self, changes: Mapping[str, Value]) -> Deviations:
        """Of every state after some changes; `UserError` where they cannot be made."""
        ...

    def notes(self) -> Iterator[str]:
        """What is to be known of it beside the figures, in sentences."""
        ...


@dataclass(frozen=True)
class Evaluated:
    """Standard deviations after one variation."""

    name: str
    deviations: Deviations
    alternative: Alternative | None = None
    """What it is of the design; None of a variation that the file asks for."""

    def change(self, base: Deviations, state: str) -> float:
        """Change of a state's standard deviation against the design, as a share."""
        before = base[state].judged
        return self.deviations[state].judged / before - 1.0 if before > 0.0 else 0.0


@dataclass(frozen=True)
class SweepPoint:
    """Standard deviations at a point of a curve."""

    sweep: str
    line: str
    point: float
    deviations: Deviations


@dataclass(frozen=True)
class Evaluation:
    """All that was asked of a design."""

    design: str
    judged: tuple[str, ...]
    base: Deviations
    evaluated: tuple[Evaluated, ...]
    sweeps: tuple[Sweep, ...]
    points: tuple[SweepPoint, ...]
    notes: tuple[str, ...] = ()

    def pays_most(self, state: str) -> Iterator[Evaluated]:
        """For each sensor the improvement that takes most off a state, the largest first."""
        best: dict[str, Evaluated] = {}
        for one in self.evaluated:
            of = one.alternative
            if of is None or of.what != BETTER.get(of.subject):
                continue
            known = best.get(of.sensor)
            if known is None or one.change(self.base, state) < known.change(self.base, state):
                best[of.sensor] = one
        yield from sorted(best.values(), key=lambda one: one.change(self.base, state))


def evaluate(design: Design) -> Evaluation:
    """Tell the covariances of a design and of all that could be otherwise.

    Raises
    ------
    UserError
        A change cannot be made, or what is left has no steady state.
    """
    base = design.deviations({})
    evaluated = [Evaluated(one.name, design.deviations(one.changes)) for one in design.variations]
    for one in design.alternatives():
        try:
            evaluated.append(Evaluated(one.name, design.deviations(one.changes), one))
        except UserError:
            # PX4 does not take the value, or the rest of the sensors cannot do without: no alternative
            continue
    points = [
        SweepPoint(sweep.name, line, point, design.deviations(sweep.changes(line, point)))
        for sweep in design.sweeps
        for line in sweep.lines
        for point in sweep.points
    ]
    notes = tuple(design.notes())
    return Evaluation(design.name, design.judged, base, tuple(evaluated), design.sweeps, tuple(points), notes)
