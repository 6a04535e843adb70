"""A flight as the checks see it, with what several of them ask for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fusetune.ekf2.feed.given_samples import GivenSamples, given_samples
from fusetune.ekf2.feed.message_samples import gnss_refusals, taken
from fusetune.px4.flight import Flight, LeftOut, TopicTable, row_count
from fusetune.px4.parameters.ekf2_parameters import complete
from fusetune.px4.sensor_limits import LACKS_FIELD
from fusetune.save.checks.logging_advice import WHOLE_LOG, log_more
from fusetune.save.thresholds import VerdictThresholds

IMU = "sensor_combined"
MAG, BARO = "vehicle_magnetometer", "vehicle_air_data"
GNSS, VISION, FLOW = "vehicle_gps_position", "vehicle_visual_odometry", "vehicle_optical_flow"
LAND_DETECTOR = "vehicle_land_detected"

IN_THE_AIR = (IMU, LAND_DETECTOR)
"""What tells when the vehicle is in the air."""
IS_COMPLETE = ("ekf2_timestamps",)
"""What names every sample that the estimator took."""
GIVEN = (
    IMU,
    *IS_COMPLETE,
    MAG,
    BARO,
    GNSS,
    VISION,
    FLOW,
    "distance_sensor",
    "airspeed",
    "airspeed_validated",
    "landing_target_pose",
)
"""What tells which samples the estimator is given."""

POSITION, ALTITUDE, VELOCITY, YAW = 0b0001, 0b0010, 0b0100, 0b1000
"""Bits of EKF2_GPS_CTRL and EKF2_EV_CTRL."""
ANY_BIT = ~0
HORIZONTAL = POSITION | VELOCITY
FIX_3D = 3
_MAG_TYPE_NONE = 5


@dataclass(frozen=True)
class JudgedFlight:
    """A flight in the layout of `fusetune.px4.layouts.release_layouts.canonical`, and the thresholds of the verdict."""

    flight: Flight
    limits: VerdictThresholds

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
        """Parameters of the estimator that the log begins with, those that it lacks at their defaults."""
        return complete(self.flight.parameters.initial, {}, self.flight.release)

    def uses(self, parameter: str, bits: int = ANY_BIT) -> bool:
        """Whether a control parameter of the estimator has any of some bits."""
        return bool(int(self.parameters[parameter]) & bits)

    @property
    def uses_magnetometer(self) -> bool:
        """Whether the estimator takes a heading from the magnetometer."""
        return self.parameters["EKF2_MAG_TYPE"] != _MAG_TYPE_NONE

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
