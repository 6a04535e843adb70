"""A design evaluated: what it is, each variation of it, what pays most per sensor, and curves.

A design of either kind is a `Design`; what differs between them is how a covariance comes about.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from fusetune.design.covariance.changes import Sweep, Value, Variation

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


Deviations = Mapping[str, Deviation]
"""By name of the state."""


@dataclass(frozen=True)
class Improvement:
    """One change of one sensor that costs something and may pay."""

    sensor: str
    what: str
    changes: Mapping[str, Value]

    @property
    def name(self) -> str:
        """What it is called in tables and figures."""
        return f"{self.sensor}: {self.what}"


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

    def improvements(self) -> Iterator[Improvement]:
        """For each sensor: half the noise, twice the rate, half the delay, and to do without."""
        ...

    def deviations(self, changes: Mapping[str, Value]) -> Deviations:
        """Of every state after some changes; `UserError` where they cannot be made."""
        ...


@dataclass(frozen=True)
class Evaluated:
    """Standard deviations after one variation."""

    name: str
    sensor: str
    """Whose improvement it is; empty of a variation that the file asks for."""
    what: str
    deviations: Deviations

    def change(self, base: Deviations, state: str) -> float:
        """Change of a state's standard deviation against the design, as a share."""
        before = base[state].before
        return self.deviations[state].before / before - 1.0 if before > 0.0 else 0.0


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

    def pays_most(self, state: str) -> Iterator[Evaluated]:
        """For each sensor the improvement that takes most off a state, the largest first; never to do without it."""
        best: dict[str, Evaluated] = {}
        for one in self.evaluated:
            if one.sensor and one.what != WITHOUT:
                known = best.get(one.sensor)
                if known is None or one.change(self.base, state) < known.change(self.base, state):
                    best[one.sensor] = one
        yield from sorted(best.values(), key=lambda one: one.change(self.base, state))


HALF_NOISE, TWICE_RATE, HALF_DELAY, NO_DELAY, WITHOUT = (
    "noise ÷2", "rate ×2", "delay ÷2", "no delay", "without it",
)  # fmt: skip


def evaluate(design: Design, improvements: Sequence[Improvement] | None = None) -> Evaluation:
    """Tell the covariances of a design and of all that could be otherwise.

    Parameters
    ----------
    improvements : which to try; by default all of `Design.improvements`

    Raises
    ------
    UserError
        A change cannot be made, or what is left has no steady state.
    """
    base = design.deviations({})
    tried = list(design.improvements()) if improvements is None else improvements
    evaluated = [Evaluated(one.name, "", "", design.deviations(one.changes)) for one in design.variations]
    evaluated += [Evaluated(one.name, one.sensor, one.what, design.deviations(one.changes)) for one in tried]
    points = [
        SweepPoint(sweep.name, line, point, design.deviations(sweep.changes(line, point)))
        for sweep in design.sweeps
        for line in sweep.lines
        for point in sweep.points
    ]
    return Evaluation(design.name, design.judged, base, tuple(evaluated), design.sweeps, tuple(points))
