"""A flight as the checks see it, with what several of them ask for."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fusetune.ekf2.feed.given_samples import GivenSamples, given_samples
from fusetune.ekf2.feed.message_samples import gnss_refusals, taken
from fusetune.px4.aid_sources import AID_SOURCES, SENSORS, AidSource
from fusetune.px4.flight import Flight, LeftOut, TopicTable, row_count
from fusetune.px4.parameters.complete_sets import complete
from fusetune.px4.releases import AUTO
from fusetune.px4.sensor_limits import LACKS_FIELD
from fusetune.save.checks.logging_advice import WHOLE_LOG, log_more
from fusetune.save.replayed_release import ReplayedRelease, replayed_release
from fusetune.save.thresholds import VerdictThresholds

IMU = "sensor_combined"
MAG, BARO, GNSS = (SENSORS[name].topics[0].name for name in ("mag", "baro", "gnss"))
LAND_DETECTOR = "vehicle_land_detected"

IN_THE_AIR = (IMU, LAND_DETECTOR)
"""What tells when the vehicle is in the air."""
IS_COMPLETE = ("ekf2_timestamps",)
"""What names every sample that the estimator took."""
GIVEN = (IMU, *IS_COMPLETE, *(topic.name for sensor in SENSORS.values() for topic in sensor.topics))
"""What tells which samples the estimator is given."""

FIX_3D = 3


@dataclass(frozen=True)
class JudgedFlight:
    """A flight in the layout of `fusetune.px4.layouts.release_layouts.canonical`, and the thresholds of the verdict.

    `release` says whose estimator is asked to replay it, as in the configuration.
    """

    flight: Flight
    limits: VerdictThresholds
    release: str = AUTO

    @cached_property
    def replayed(self) -> ReplayedRelease:
        """Whose estimator replays it, and why."""
        return replayed_release(self.flight, self.release)

    @property
    def imu(self) -> TopicTable:
        """Samples of the IMU.

        Raises
        ------
        KeyError
            There are none, which `fusetune.save.checks.imu.imu_present` tells.
        """
        return self.flight.topics[IMU, 0]

    @cached_property
    def begin_us(self) -> int:
        """Time of the first IMU sample."""
        return int(self.imu["timestamp"].min())

    @cached_property
    def parameters(self) -> dict[str, float]:
        """Parameters of the estimator that the log begins with, those that it lacks at their defaults.

        These are the defaults of the release whose estimator replays it.
        """
        initial, flown = self.flight.parameters.initial, self.flight.release
        return complete(initial, {}, flown, replayed=self.replayed.release)

    def may_fuse(self, source: AidSource) -> bool:
        """Whether the parameters let a source be fused."""
        return source.switch is None or source.switch.is_on(self.parameters[source.switch.parameter])

    def is_switched_on(self, part: str) -> bool:
        """Whether a source of some samples, by the name of their sensor or part of it, may be fused."""
        sources = [one for one in AID_SOURCES.values() if one.code is not None and part in (one.sensor, one.part)]
        return any(map(self.may_fuse, sources))

    def has_samples(self, source: AidSource) -> bool:
        """Whether the log holds samples that a source can be made of."""
        if source.sensor == "gnss":
            return bool(self.usable_fixes)
        if not SENSORS[source.sensor].buffered:
            return any(self.flight.topic(topic.name) is not None for topic in SENSORS[source.sensor].topics)
        return self.is_given(source.part or source.sensor)

    def from_sensors(self, sources: Iterable[AidSource]) -> list[str]:
        """Labels of the sensors, as each of some sources has its samples and may be fused."""
        labels = (SENSORS[one.sensor].label for one in sources if self.may_fuse(one) and self.has_samples(one))
        return list(dict.fromkeys(labels))

    @cached_property
    def given(self) -> dict[str, GivenSamples]:
        """What the estimator is given of each sensor of which the log holds messages."""
        return given_samples(self.flight)

    def is_given(self, sensor: str) -> bool:
        """Whether the estimator is given a sample of a sensor."""
        return sensor in self.given and bool(self.given[sensor].given)

    @cached_property
    def fix_share(self) -> float:
        """Share of the GNSS samples that have a 3D fix."""
        table = self.flight.topic(GNSS)
        return 0.0 if table is None or not row_count(table) else float(np.mean(table["fix_type"] >= FIX_3D))

    @cached_property
    def usable_fixes(self) -> int:
        """GNSS samples with a 3D fix that the estimator is given."""
        table = self.flight.topic(GNSS)
        if table is None or not self.is_given("gnss"):
            return 0
        usable = taken(table, gnss_refusals(table, self.flight.release))
        return int(np.sum(usable & (table["fix_type"] >= FIX_3D)))

    def lacks_fields(self, topic: str) -> LeftOut | None:
        """The topic as it was left out, since it lacks a field that the estimator needs."""
        entries = (entry for entry in self.flight.left_out if entry.topic == topic and not self.flight.has(topic))
        return next((entry for entry in entries if entry.reason.startswith(LACKS_FIELD)), None)

    def why_no_samples(self, topic: str, words: str) -> tuple[str, str]:
        """Why there are no messages of a topic, and the remedy."""
        entry = self.lacks_fields(topic)
        if entry is None:
            return f"no {words} samples", log_more(self.flight, topic)
        return f"no {words} samples that can be used (each {entry.reason})", WHOLE_LOG
