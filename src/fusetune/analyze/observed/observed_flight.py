"""A flight as the vehicle logged it and as it is replayed; what is expensive is made when it is first asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TypeVar

from fusetune.analyze.delays.inertial_motion import InertialMotion, inertial_motion
from fusetune.analyze.delays.sensor_delays import SensorDelay, sensor_delays, velocity_place_of
from fusetune.analyze.delays.velocity_place import VelocityPlace
from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.analyze.observed.body_motion import BodyMotion, body_motion
from fusetune.analyze.replaying.prepared_flight import PreparedFlight, prepare_flight
from fusetune.analyze.replaying.replay_flight import replay_set, write_replay
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.replaying.settings import IN_USE, ReplaySettings
from fusetune.analyze.replaying.store.reader import read_set
from fusetune.px4.flight import Flight
from fusetune.px4.layouts.estimator_instances import rows_of_primary
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.parameters.complete_sets import complete
from fusetune.save.replayed_release import replayed_release
from fusetune.save.verdict import Verdict, judge
from fusetune.set_names import AS_FLOWN, PRESENT
from fusetune.storage.freed_memory import give_back_freed_memory

Made = TypeVar("Made")

GROUND_EFFECT_US = 5_000_000
"""After take-off and before landing the ground still shows in the sensors (PX4's ecl_ekf scripts cut as much)."""


@dataclass(frozen=True)
class ObservedFlight:
    """One flight of any release.

    Attributes
    ----------
    logged : as it was logged: all topics and instances, in the layout of its release
    settings : how it is replayed
    scratch : folder for the replay of a long flight, which is read from there; without it all stays in memory
    """

    logged: Flight
    settings: ReplaySettings = field(default=IN_USE)
    scratch: Path | None = None

    @cached_property
    def flight(self) -> Flight:
        """In the layout of v1.16, with the sensors of the estimator instance that was primary at the time."""
        return canonical(self.logged)

    @cached_property
    def verdict(self) -> Verdict:
        """Whether it can be replayed, by the thresholds that are in use unless told otherwise."""
        return judge(self.flight)

    @cached_property
    def parameters(self) -> dict[str, float]:
        """Parameters of the estimator that the log begins with, those that it lacks at their defaults.

        These are the defaults of the release whose estimator replays it.
        """
        replayed = replayed_release(self.flight, self.settings.release).release
        return complete(self.flight.parameters.initial, {}, self.flight.release, replayed=replayed)

    @cached_property
    def airborne(self) -> tuple[Interval, ...]:
        """When the vehicle was in the air, µs; as its estimator saw it where the log has no land detector."""
        return airborne_intervals(self.flight, rows_of_primary(self.flight, "estimator_status_flags") or {})

    @cached_property
    def clear_of_ground(self) -> tuple[Interval, ...]:
        """In the air, without take-off and landing."""
        cut = ((start + GROUND_EFFECT_US, stop - GROUND_EFFECT_US) for start, stop in self.airborne)
        return tuple(one for one in cut if one[0] < one[1])

    @cached_property
    def prepared(self) -> PreparedFlight:
        """Ready for replays, with all that is asked for in `settings`."""
        return prepare_flight(self.flight, self.settings)

    @cached_property
    def replayed(self) -> ReplayedSet:
        """The replay with the parameters that flew."""
        return self._replayed(AS_FLOWN, {})

    def _replayed(self, name: str, overrides: Mapping[str, float]) -> ReplayedSet:
        if self.scratch is None or not self.prepared.is_long:
            return replay_set(self.prepared, name, overrides)
        # what the next replay would share with this one is the larger part of what it leaves in memory
        write_replay(self.prepared.without_schedules(), name, overrides, self.scratch)
        give_back_freed_memory()
        return read_set(self.scratch, name)

    @cached_property
    def inertial(self) -> InertialMotion | None:
        """The motion that the IMU alone tells; None where log and replay hardly overlap."""
        imu = self.prepared.reconstructed.flight.topics["sensor_combined", 0]
        return _lean(inertial_motion(imu, self.replayed.states()))

    @cached_property
    def motion(self) -> BodyMotion | None:
        """Velocity, attitude, specific force and height on an even grid; None where `inertial` is."""
        if self.inertial is None or self.replayed.steps is None:
            return None
        return _lean(body_motion(self.replayed.steps(), self.inertial, self.flight, self.parameters))

    @cached_property
    def gnss_place(self) -> VelocityPlace | None:
        """Delay and place of the GNSS antenna; None where the flight does not tell them."""
        return _lean(velocity_place_of(self.replayed, "gnss", self.airborne))

    def flew_with(self, overrides: Mapping[str, float]) -> bool:
        """Whether a replay with these values of parameters is the one with those that flew."""
        return self.prepared.course_of(overrides) == self.prepared.course_of({})

    def delays(self, overrides: Mapping[str, float]) -> tuple[SensorDelay, ...]:
        """Delays of the sensors, by a replay with other values of parameters; that which flew where it is the same."""
        if not self.flew_with(overrides):
            return sensor_delays(self.prepared, self._replayed(PRESENT, overrides))
        in_air = airborne_intervals(self.flight, self.replayed.flags)
        places = {"gnss": self.gnss_place} if in_air == self.airborne else {}
        return sensor_delays(self.prepared, self.replayed, motion=self.inertial, places=places)

    def without_replay(self) -> ObservedFlight:
        """The same flight, prepared, and none of what takes memory with the length of its replay."""
        other = ObservedFlight(self.logged, self.settings, self.scratch)
        other.__dict__.update(flight=self.flight, prepared=self.prepared)
        return other

    def since_start_s(self, timestamp: int) -> float:
        """Seconds from the start of the log, for a time in µs since boot."""
        return (timestamp - self.logged.start_timestamp) * 1e-6


def _lean(made: Made) -> Made:
    """What was made, without the memory that making it took."""
    give_back_freed_memory()
    return made
