"""Flights of a vehicle that are unlike its others, in figures whose spread over the others is known."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.stats import false_discovery_control, t

from fusetune.apply.fleet.distribution import robust_scale
from fusetune.apply.fleet.flights import OF_FLIGHT, SEVERITIES, FleetTable
from fusetune.apply.fleet.levels import FALSE_SHARE, FEWEST_FLIGHTS

SMALLEST_Z = 3.5
"""From here on Iglewicz and Hoaglin (How to detect and handle outliers, 1993) label a value; chance asks for more."""

MOST_ALIKE = 0.2
"""Of a vehicle's flights, as many may be unlike the others in a figure; more are a kind of their own."""

_ROUNDING = 1e-9
_EFFICIENCY_OF_QN = 0.82
_VARIANCE_OF_MEDIAN = 0.5 * math.pi
"""Times n, of normal values with unit variance."""


@dataclass(frozen=True)
class Outlier:
    """A figure of a flight that lies far from those of the others.

    Attributes
    ----------
    value, usual : of the flight, and the vehicle's median
    z : (value − median) / Qn; of logarithms where a figure is above zero on all flights
    chance : share of such findings that would be chance (Benjamini and Yekutieli's adjusted p)
    severity : how the health table judges the value
    """

    flight: str
    id: str
    unit: str
    value: float
    usual: float
    z: float
    chance: float
    severity: str


def outliers(table: FleetTable) -> tuple[Outlier, ...]:
    """All that stand out, the farthest first.

    Each flight is compared with all of its vehicle, for vehicles differ in more than what is wrong with them; median
    and Qn hardly notice that it is among them. z follows Student's t with as many degrees of freedom as Qn is
    efficient; the chances of all figures and flights together are corrected for their number, however they depend on
    each other. What more than `MOST_ALIKE` of a vehicle's flights show is another way of flying, and no outlier.

    References
    ----------
    Benjamini and Yekutieli, "The control of the false discovery rate in multiple testing under dependency", Annals of
    Statistics 29, 2001.
    """
    compared = [
        one
        for vehicle in table.vehicles
        for column in range(len(table.figures))
        for one in _compared(table, table.rows_of(vehicle), column)
    ]
    if not compared:
        return ()
    adjusted = false_discovery_control([chance for _, chance in compared], method="by")
    named = [
        replace(one, chance=float(chance))
        for (one, _), chance in zip(compared, adjusted, strict=True)
        if chance <= FALSE_SHARE
    ]
    figures = {(one.id, one.unit): one for one in table.figures}
    kept = [
        one for one in named if abs(one.z) >= SMALLEST_Z and figures[one.id, one.unit].matters(one.value, one.usual)
    ]
    vehicles = {one.name: one.vehicle for one in table.flights}
    alike = Counter((vehicles[one.flight], one.id, one.unit) for one in kept)
    of_one = Counter(vehicles.values())
    few = [
        one
        for one in kept
        if alike[vehicles[one.flight], one.id, one.unit] <= MOST_ALIKE * of_one[vehicles[one.flight]]
    ]
    return tuple(sorted(few, key=lambda one: (-abs(one.z), one.flight, one.id)))


def _compared(table: FleetTable, rows: npt.NDArray[np.intp], column: int) -> Iterator[tuple[Outlier, float]]:
    """Each flight of a vehicle against all of them in one figure, with the chance of that comparison by itself."""
    figure, values = table.figures[column], table.values[:, column]
    known = rows[np.isfinite(values[rows])]
    if known.size < FEWEST_FLIGHTS or figure.group == OF_FLIGHT:
        return
    scaled = np.log(values[known]) if np.all(values[known] > 0.0) else values[known]
    centre, scale = float(np.median(scaled)), robust_scale(scaled)
    # distances that rounding alone makes are none
    if scale <= _ROUNDING * float(np.max(np.abs(scaled))):
        return
    usual = float(np.median(values[known]))
    for row, place in zip(known, scaled, strict=True):
        z = (float(place) - centre) / scale
        widened = abs(z) / math.sqrt(1.0 + _VARIANCE_OF_MEDIAN / known.size)
        chance = 2.0 * float(t.sf(widened, _EFFICIENCY_OF_QN * (known.size - 1)))
        severity = SEVERITIES[table.severities[row, column]]
        yield (
            Outlier(table.flights[row].name, figure.id, figure.unit, float(values[row]), usual, z, 1.0, severity),
            chance,
        )
