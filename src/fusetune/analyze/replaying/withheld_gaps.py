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


def plan_gaps(flight: Flight, airborne: Sequence[Interval], settings: WithholdingSettings) -> list[Gap]:
    """Gaps of every sensor that the log has, staggered over the time in flight, in the order of their sensors.

    They depend on the flight alone, so that all parameter sets are compared on the same gaps.
    """
    gaps = []
    for sensor in WITHHOLDABLE:
        length, step = (round(seconds * 1e6) for seconds in (settings.length_s(sensor), settings.every_s(sensor)))
        if length == 0 or flight.topic(SENSORS[sensor].topics[0].name) is None:
            continue
        for start, stop in airborne:
            gaps += [Gap(sensor, first, first + length) for first in range(start, stop - length + 1, step)]
    return gaps
