"""Which flights a verdict on the fleet hangs on: each left out in turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.apply.fleet.flights import SEVERITIES

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Driver:
    """A flight without which a figure would be judged otherwise, or its mean would be another.

    Attributes
    ----------
    worst, typical : severities without it
    mean, median : without it; None where no other flight tells the figure
    """

    flight: str
    worst: str
    typical: str
    mean: float | None
    median: float | None


@dataclass(frozen=True)
class FleetVerdict:
    """How a figure is judged over the flights that it applies to.

    Attributes
    ----------
    worst : the severity of the worst flight
    typical : a severity that at least half of the flights reach
    flights : how many it applies to
    counts : flights by severity, those that occur
    drivers : flights without which `worst` or `typical` is another, or which alone move the mean by more than its
        standard error
    """

    worst: str
    typical: str
    flights: int
    counts: dict[str, int]
    drivers: tuple[Driver, ...]


def fleet_verdict(names: list[str], values: Array, severities: npt.NDArray[np.int8]) -> FleetVerdict:
    """Judge one figure.

    Parameters
    ----------
    names : of the flights
    values, severities : (F,) as in `FleetTable`
    """
    judged = np.flatnonzero(severities)
    worst, typical = _judged(severities[judged])
    found = []
    for row in judged.tolist():
        others = judged[judged != row]
        without = _judged(severities[others])
        rest = values[others][np.isfinite(values[others])]
        if without != (worst, typical) or _moves_mean(float(values[row]), rest):
            mean, median = (float(np.mean(rest)), float(np.median(rest))) if rest.size else (None, None)
            found.append(Driver(names[row], *without, mean, median))
    counts = {name: int(np.count_nonzero(severities == place)) for place, name in enumerate(SEVERITIES) if place}
    told: dict[str, int] = {name: count for name, count in counts.items() if count}
    return FleetVerdict(worst, typical, judged.size, told, tuple(found))


def _judged(severities: npt.NDArray[np.int8]) -> tuple[str, str]:
    """Worst and typical: of an even number of flights the worse of the two in the middle."""
    if not severities.size:
        return SEVERITIES[0], SEVERITIES[0]
    order = np.sort(severities)
    return SEVERITIES[order[-1]], SEVERITIES[order[order.size // 2]]


def _moves_mean(value: float, others: Array) -> bool:
    """Whether a value moves the mean of the others by more than their mean's standard error."""
    if others.size < 2 or not np.isfinite(value):
        return False
    shift = abs(value - float(others.mean())) / (others.size + 1)
    return shift > float(others.std(ddof=1)) / np.sqrt(others.size)
