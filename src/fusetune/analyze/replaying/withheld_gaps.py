"""Gaps in which a sensor is withheld from the filter: where they lie in a flight.

The innovation of one step ahead shows how well a filter follows its sensor; a filter that follows the sensor's slow
errors looks good by it. After seconds without the sensor, only what the filter knew of velocity, attitude and biases
counts.
"""

from __future__ import annotations

from collections.abc import Sequence

from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.replaying.settings import WithholdingSettings
from fusetune.ekf2.replay.results import Gap
from fusetune.px4.aid_sources import SENSORS, WITHHOLDABLE
from fusetune.px4.flight import Flight

LEAD_IN_S = 6.0
"""After take-off so much is seldom scored: above 1.5 m the heading is aligned anew, and some seconds after that reset
are cut. On 20 of 29 flights of several vehicles that took 3.5 to 6.3 s."""

_SHORTER = (1.0, 2.0 / 3.0, 1.0 / 3.0)
"""Lengths of gaps without GNSS in parts of the full one: the predictions after a third of one are those at the end of
another, and 1 s, over which predictions are averaged, is a third of the shortest by default."""


def plan_gaps(flight: Flight, airborne: Sequence[Interval], settings: WithholdingSettings) -> list[Gap]:
    """Gaps of every sensor that the log has, staggered over the time in flight, in the order of their sensors.

    They depend on the flight alone, so that all parameter sets are compared on the same gaps.
    """
    gaps = []
    for sensor in WITHHOLDABLE:
        length, step = (round(seconds * 1e6) for seconds in (settings.length_s(sensor), settings.every_s(sensor)))
        if length == 0 or flight.topic(SENSORS[sensor].topics[0].name) is None:
            continue
        if sensor == "gnss":
            part = _part_that_fits(airborne, length, step, settings.gnss_fewest)
            length, step = round(part * length), round(part * step)
        for interval in airborne:
            gaps += [Gap(sensor, first, first + length) for first in _starts(interval, length, step)]
    return gaps


def _part_that_fits(airborne: Sequence[Interval], length: int, step: int, fewest: int) -> float:
    """By how much gaps must be shorter for enough of them to lie in what is left of the flight after the lead-in."""
    lead_in = round(LEAD_IN_S * 1e6)
    for part in _SHORTER:
        rows = [_starts((start + lead_in, stop), round(part * length), round(part * step)) for start, stop in airborne]
        if sum(len(row) for row in rows) >= fewest:
            return part
    return _SHORTER[-1]


def _starts(interval: Interval, length: int, step: int) -> range:
    start, stop = interval
    return range(start, stop - length + 1, step)
