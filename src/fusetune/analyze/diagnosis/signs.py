"""What a flight shows, for the rules of `causes` to ask; each sign is made when it is first asked for, once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fusetune.analyze.delays.velocity_place import VelocityPlace
from fusetune.analyze.diagnosis.airspeed_signs import AirspeedSigns, airspeed_signs
from fusetune.analyze.diagnosis.barometer_signs import BarometerSigns, barometer_signs
from fusetune.analyze.diagnosis.beam_signs import RangeSigns, range_signs
from fusetune.analyze.diagnosis.claims import AtLimit, NoiseClaim, at_limits, noise_claims
from fusetune.analyze.diagnosis.flow_signs import FlowSigns, flow_signs
from fusetune.analyze.diagnosis.gnss_motion import GnssMotion, gnss_motion
from fusetune.analyze.diagnosis.gnss_signs import GnssSigns, gnss_signs
from fusetune.analyze.diagnosis.imu_signs import GyroBias, ImuSigns, gyro_bias, imu_signs
from fusetune.analyze.diagnosis.innovation_signs import SourceRatios, flown_ratios, replayed_ratios
from fusetune.analyze.diagnosis.magnetometer_signs import MagnetometerSigns, magnetometer_signs
from fusetune.analyze.diagnosis.motion import Motion, motion_of
from fusetune.analyze.diagnosis.told_effects import ToldEffects
from fusetune.analyze.diagnosis.vision_signs import VisionSigns, vision_signs
from fusetune.analyze.effects.all_effects import FlightEffects
from fusetune.analyze.effects.static_pressure import LEAST_SPEED_M_S
from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.finding import Finding
from fusetune.px4.flight import TopicTable
from fusetune.px4.layouts.estimator_instances import instance_switches
from fusetune.save.checks.judged_flight import JudgedFlight
from fusetune.save.checks.magnetometer_mounting import attitudes_and_fields, magnetometer_mounting, stillest_mounting
from fusetune.save.checks.standstill import Standstill, flying_steps, standstill
from fusetune.save.thresholds import VerdictThresholds

STUCK_COLUMNS = {
    "mag": ("vehicle_magnetometer", ("magnetometer_ga[0]", "magnetometer_ga[1]", "magnetometer_ga[2]")),
    "baro": ("vehicle_air_data", ("baro_alt_meter",)),
    "gnss": ("vehicle_gps_position", ("latitude_deg", "longitude_deg", "altitude_msl_m", "vel_n_m_s", "vel_e_m_s")),
}
FRAME_NED = 1
STUCK_S = 2.0
"""No sensor that works repeats all of its digits so long (fusetune's verdict asks the same of a log)."""


@dataclass(frozen=True)
class Signs:
    """All signs of one flight.

    Attributes
    ----------
    observed : the flight
    effects : its single effects, where they are asked for elsewhere as well
    """

    observed: ObservedFlight
    effects: FlightEffects | None = None

    @cached_property
    def is_replayed(self) -> bool:
        """Whether there is a replay: of a log that is refused there is none, and rules go by what it holds."""
        return self.observed.verdict.status == "replayable" and bool(self.observed.airborne)

    @property
    def airborne(self) -> tuple[Interval, ...]:
        """In the air, µs; on a log that does not tell, all of it."""
        return self.observed.airborne

    @property
    def whole(self) -> Interval:
        """From take-off to landing, µs."""
        if not self.airborne:
            return self.observed.flight.start_timestamp, self.observed.flight.last_timestamp
        return self.airborne[0][0], self.airborne[-1][1]

    @cached_property
    def parameters(self) -> dict[str, float]:
        """Parameters of the estimator, those that the log lacks at their defaults."""
        return self.observed.parameters

    def table(self, topic: str) -> TopicTable | None:
        """A topic in v1.16's layout."""
        return self.observed.flight.topic(topic)

    @cached_property
    def motion(self) -> Motion | None:
        """How the vehicle moved; None without a replay."""
        if not self.is_replayed:
            return None
        return motion_of(self.observed.replayed, self.observed.flight, self.airborne)

    @cached_property
    def imu(self) -> ImuSigns | None:
        """Shaking, clipping, gaps."""
        return imu_signs(self.observed.flight, self.airborne)

    @cached_property
    def gyro_bias(self) -> GyroBias | None:
        """Bias of the gyros."""
        steps = self.observed.replayed.steps if self.is_replayed else None
        return gyro_bias(self.observed.flight, steps() if steps is not None else None, self.airborne)

    @cached_property
    def gnss(self) -> GnssSigns | None:
        """Messages of the receiver."""
        return gnss_signs(self.table("vehicle_gps_position"), self.airborne, self.motion)

    @cached_property
    def gnss_sound(self) -> tuple[Interval, ...]:
        """In the air without the times that the receiver was poor, lost, jammed or stuck, nor its jumps, µs."""
        bad = (
            [] if self.gnss is None else [*self.gnss.lost, *(one for one in (self.gnss.poor, self.gnss.jammed) if one)]
        )
        if "gnss" in self.stuck:
            bad.append((self.stuck["gnss"].start_us, self.stuck["gnss"].stop_us))
        jumps = [one.time for one in self.gnss.jumps] if self.gnss is not None else []
        if jumps:
            bad.append((min(jumps) - 500_000, max(jumps) + 500_000))
        intervals = list(self.airborne)
        for start, stop in bad:
            pieces = []
            for first, last in intervals:
                pieces += [(first, min(last, start)), (max(first, stop), last)]
            intervals = [one for one in pieces if one[1] - one[0] > 2_000_000]
        return tuple(sorted(set(intervals)))

    @cached_property
    def gnss_motion(self) -> GnssMotion | None:
        """Velocity of the receiver against the IMU, where the receiver was sound."""
        if self.motion is None:
            return None
        return gnss_motion(self.table("vehicle_gps_position"), self.motion, self.gnss_sound, self.parameters)

    @cached_property
    def told_by(self) -> ToldEffects:
        """Estimates of the tuners of single effects."""
        return ToldEffects(self._tuned)

    @cached_property
    def _tuned(self) -> FlightEffects | None:
        return (self.effects or FlightEffects(self.observed)) if self.is_replayed else None

    @property
    def gnss_place(self) -> VelocityPlace | None:
        """Delay and antenna by the smoothed velocity; dearer than other signs, so asked where one speaks."""
        return self.observed.gnss_place if self.is_replayed else None

    @cached_property
    def magnetometer(self) -> MagnetometerSigns | None:
        """Readings against the earth's field."""
        if self.motion is None:
            return None
        found = self.gnss_motion
        heading = (found.heading, found.heading_error) if found is not None else None
        return magnetometer_signs(self.observed.flight, self.motion, self.airborne, heading)

    @cached_property
    def mounting(self) -> tuple[Finding, np.ndarray] | None:
        """What the verdict says of the magnetometer's mounting, by tilt alone, and the mounting that it found.

        The mounting is a rotation (3, 3) from axes that turn with the vehicle to those of the samples; None where the
        verdict says nothing.
        """
        found = magnetometer_mounting.findings(JudgedFlight(self.observed.flight, VerdictThresholds()))[0]
        together = attitudes_and_fields(self.observed.flight)
        if found.severity != "warning" or together is None:
            return None
        return found, stillest_mounting(*together)[0]

    @cached_property
    def barometer(self) -> BarometerSigns | None:
        """Readings against the vehicle's motion."""
        if self.motion is None:
            return None
        stuck = self.stuck.get("baro")
        out = (stuck.start_us, stuck.stop_us) if stuck is not None else None
        return barometer_signs(self.observed.flight, self.motion, self.airborne, out, self.wind)

    @cached_property
    def wind(self) -> np.ndarray | None:
        """Wind at the times of the motion by the drag that the vehicle feels, (N, 2), north and east, m/s.

        None where the flight does not tell it, or is too slow for it to matter.
        """
        motion = self.motion
        if motion is None:
            return None
        level = np.hypot(*motion.velocity[inside(motion.time, self.airborne), :2].T)
        if float(np.max(level)) < LEAST_SPEED_M_S or self._tuned is None or isinstance(self._tuned.drag, str):
            return None
        return self._tuned.drag.wind(np.asarray(motion.time * 1e-6, np.float64))

    @cached_property
    def range(self) -> RangeSigns | None:
        """Range finder that looks down."""
        return None if self.motion is None else range_signs(self.observed.flight, self.motion, self.airborne)

    @cached_property
    def flow(self) -> FlowSigns | None:
        """Optical flow."""
        if self.motion is None:
            return None
        record = self.observed.replayed
        return flow_signs(self.observed.flight, record.states(), self.airborne, self.parameters)

    @cached_property
    def vision(self) -> VisionSigns | None:
        """External vision."""
        if self.motion is None:
            return None
        found = self.gnss_motion
        by_gnss = found is not None and found.heading_error < np.radians(4.0)
        heading = found.heading if found is not None and by_gnss else float(np.median(self.motion.heading_off))
        return vision_signs(self.observed.flight, self.motion, self.airborne, self.parameters, heading, by_gnss)

    @cached_property
    def airspeed(self) -> AirspeedSigns | None:
        """Airspeed."""
        return None if self.motion is None else airspeed_signs(self.observed.flight, self.motion, self.airborne)

    @property
    def vision_knows_north(self) -> bool:
        """Whether vision says that its frame is north, east, down."""
        table = self.table("vehicle_visual_odometry")
        return table is not None and bool(np.any(table.get("pose_frame", np.zeros(1)) == FRAME_NED))

    @cached_property
    def ratios(self) -> dict[str, SourceRatios]:
        """Test ratios of the replay, or the vehicle's own where there is none."""
        if self.is_replayed:
            return replayed_ratios(self.observed.replayed, self.airborne)
        return flown_ratios(self.observed.flight, self.airborne)

    @cached_property
    def claims(self) -> dict[str, NoiseClaim]:
        """Claimed noises against what the sensors do."""
        measured, reported = {}, {}
        if self.gnss_motion is not None:
            measured["gnss_vel"] = self.gnss_motion.fit.noise
        if self.gnss is not None:
            reported = {
                "gnss_vel": self.gnss.usual.get("s_variance_m_s", 0.0),
                "gnss_pos": self.gnss.usual.get("eph", 0.0),
            }
            measured["gnss_pos"] = self.gnss.position_noise
        if self.barometer is not None:
            measured["baro_hgt"] = self.barometer.noise
        if self.magnetometer is not None:
            measured["mag"] = self.magnetometer.reading_noise
        rejected = {name: one.above_gate for name, one in self.ratios.items()}
        return noise_claims(self.parameters, measured, reported, rejected)

    @cached_property
    def at_limits(self) -> tuple[AtLimit, ...]:
        """Parameters at a bound."""
        release = self.observed.flight.release
        return at_limits(self.parameters, release[:2] if release is not None else None)

    @cached_property
    def stuck(self) -> dict[str, Standstill]:
        """Sensors that repeat one value in the air for longer than `STUCK_S`, and how long."""
        found = {}
        flight = self.observed.flight
        for sensor, (topic, columns) in STUCK_COLUMNS.items():
            table = flight.topic(topic)
            if table is None or any(one not in table for one in columns) or table["timestamp"].size < 10:
                continue
            one = standstill(table, columns, STUCK_S, flying_steps(flight, table))
            if one.longest_s > STUCK_S:
                found[sensor] = one
        return found

    @cached_property
    def switches(self) -> np.ndarray:
        """Times at which another estimator instance took over, in the air, µs."""
        times = instance_switches(self.observed.logged)
        start, stop = self.whole
        return times[(times >= start) & (times < stop)]
