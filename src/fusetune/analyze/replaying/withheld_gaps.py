"""Gaps in which a sensor is withheld from the filter: where they lie in a flight.

The innovation of one step ahead shows how well a filter follows its sensor; a filter that follows the sensor's slow
errors looks good by it. After seconds without the sensor, only what the filter knew of velocity, attitude and biases
counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fusetune.analyze.flight.intervals import Interval
from fusetune.ekf2.replay.results import Gap
from fusetune.px4.aid_sources import SENSORS, WITHHOLDABLE
from fusetune.px4.flight import Flight
from fusetune.settings import setting, settings_from_mapping
from fusetune.storage.files import AnyPath


@dataclass(frozen=True)
class WithholdingSettings:
    """How long each sensor is withheld, and how often; a length of 0 leaves a sensor alone."""

    gnss_s: float = setting(9.0, 0.0, 60.0, "s", "length of the gaps without GNSS")
    gnss_every_s: float = setting(4.5, 0.5, 600.0, "s", "time from the start of one gap without GNSS to the next")
    baro_s: float = setting(9.0, 0.0, 60.0, "s", "length of the gaps without barometer")
    baro_every_s: float = setting(18.0, 0.5, 600.0, "s", "time from the start of one gap without barometer to the next")
    mag_s: float = setting(9.0, 0.0, 60.0, "s", "length of the gaps without magnetometer")
    mag_every_s: float = setting(
        18.0, 0.5, 600.0, "s", "time from the start of one gap without magnetometer to the next"
    )

    @classmethod
    def from_mapping(
        cls, values: Mapping[str, Any] | None, file: AnyPath = "config/config.yaml"
    ) -> WithholdingSettings:
        """Read the section `withheld`; a missing section or key means the default."""
        return settings_from_mapping(cls, values, "withheld", file)

    def length_s(self, sensor: str) -> float:
        """Length of a sensor's gaps, s."""
        return float(getattr(self, f"{sensor}_s"))

    def every_s(self, sensor: str) -> float:
        """Time between the starts of two gaps of a sensor, s."""
        return float(getattr(self, f"{sensor}_every_s"))


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
