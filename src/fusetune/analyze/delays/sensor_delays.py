"""The delays of a flight's sensors against what PX4 is told of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from fusetune.analyze.delays.delayed_series import airspeed_series, flow_series, range_series, vision_series
from fusetune.analyze.delays.inertial_motion import InertialMotion, inertial_motion
from fusetune.analyze.delays.lag import Lag, LaggedSeries, lag_of
from fusetune.analyze.delays.velocity_place import CERTAIN_S, VelocityPlace, velocity_place
from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.flight.phases import airborne_intervals
from fusetune.analyze.replaying.prepared_flight import PreparedFlight
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.design.tunable_parameters import ARM_PARAMETERS, DELAY_LIMIT
from fusetune.px4.aid_sources import AID_SOURCES, SENSORS
from fusetune.px4.flight import Flight
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS, is_had_by

CONFIDENCE = 0.95
LAG_UNCERTAINTY = 2.0
"""Factor on the standard errors of `lag`: on made flights the error of its estimates is up to twice what their
residuals promise, as the drift of the inertial solution is not all of the kind that an autoregressive model holds."""

Series = Callable[[Flight, InertialMotion, Mapping[str, float]], LaggedSeries | None]

LAGGED: Mapping[str, Series] = {
    "range": range_series, "flow": flow_series, "ev": vision_series, "airspeed": airspeed_series,
}  # fmt: skip
"""Sensor → its measurements beside the motion; velocities are estimated by `velocity_place`."""
VELOCITIES = {"gnss": "gnss_vel"}
IMU_PARAMETERS = ("EKF2_IMU_POS_X", "EKF2_IMU_POS_Y", "EKF2_IMU_POS_Z")


@dataclass(frozen=True)
class SensorDelay:
    """Delay of one sensor on one flight.

    Attributes
    ----------
    sensor : key of `fusetune.px4.aid_sources.SENSORS`
    parameter : that tells PX4 the delay
    told_ms : its value on the flight
    value_ms, lower_ms, upper_ms : the delay and its interval (`CONFIDENCE`)
    standard_error_ms : of the delay
    n : measurements behind it
    reach_ms : EKF2_DELAY_MAX that the vehicle flew with; None where the release that replays it has none, for there
        the delays alone size the buffers
    """

    sensor: str
    parameter: str
    told_ms: float
    value_ms: float
    lower_ms: float
    upper_ms: float
    standard_error_ms: float
    n: int
    reach_ms: float | None

    def document(self) -> dict[str, Any]:
        """As JSON holds it."""
        return asdict(self) | {"unit": "ms"}

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> SensorDelay:
        """Read what `document` made."""
        return cls(**{name: value for name, value in document.items() if name != "unit"})


def sensor_delays(
    prepared: PreparedFlight,
    record: ReplayedSet,
    *,
    motion: InertialMotion | None = None,
    places: Mapping[str, VelocityPlace | None] | None = None,
) -> tuple[SensorDelay, ...]:
    """Delays of the sensors that a replay fused and whose delay the flight tells.

    Parameters
    ----------
    record : replay of any set on the flight; what it was told of the delays does not matter for what is found
    motion : of this replay, where it is known
    places : sensor → what `velocity_place_of` told of it, of this replay, where it has been asked
    """
    intervals, known = airborne_intervals(prepared.flight, record.flags), places or {}
    has_reach = is_had_by(DELAY_LIMIT, prepared.replayed.release)
    reach_ms, found = _told(record, DELAY_LIMIT) if has_reach else None, []
    for sensor in (*VELOCITIES, *LAGGED):
        parameter = SENSORS[sensor].delay_parameter
        told_s = _told(record, parameter) * 1e-3
        if not any(AID_SOURCES[source].sensor == sensor for source in record.fused_sources):
            continue
        if sensor in VELOCITIES:
            place = known[sensor] if sensor in known else velocity_place_of(record, sensor, intervals)
            lag = None if place is None else place.lag
        else:
            imu = prepared.reconstructed.flight.topics["sensor_combined", 0]
            motion = motion or inertial_motion(imu, record.states())
            series = LAGGED[sensor](prepared.flight, motion, record.parameters) if motion is not None else None
            lag = _lag(series, intervals, told_s)
        if lag is not None:
            found.append(_delay(sensor, parameter, told_s, lag, reach_ms))
    return tuple(found)


def velocity_place_of(record: ReplayedSet, sensor: str, intervals: Sequence[Interval]) -> VelocityPlace | None:
    """Delay and place of a sensor of `VELOCITIES`, from a replay of any set; None where the flight does not tell.

    The place is in the frame of PX4's parameters, in which the IMU has a place of its own (EKF2_IMU_POS_*).
    """
    told_s = 1e-3 * _told(record, SENSORS[sensor].delay_parameter)
    imu = np.array([_told(record, one) for one in IMU_PARAMETERS])
    arm = np.array([_told(record, one) for one in ARM_PARAMETERS[sensor]]) - imu
    place = velocity_place(record, VELOCITIES[sensor], intervals, told_s, arm.tolist())
    return None if place is None else replace(place, arm=place.arm + imu)


def _told(record: ReplayedSet, parameter: str) -> float:
    return record.parameters.get(parameter, PARAMETERS[parameter].default)


def _lag(series: LaggedSeries | None, intervals: Sequence[Any], told_s: float) -> Lag | None:
    if series is None:
        return None
    series = series.rows(inside(series.time - round(told_s * 1e6), intervals))
    lag = lag_of(series, told_s) if series.time.size else None
    if lag is None:
        return None
    error_s = LAG_UNCERTAINTY * lag.standard_error_s
    return Lag(lag.delay_s, error_s, lag.freedom, lag.samples) if error_s <= CERTAIN_S else None


def _delay(sensor: str, parameter: str, told_s: float, lag: Lag, reach_ms: float | None) -> SensorDelay:
    value, half, error = (
        round(1e3 * one, 1) for one in (lag.delay_s, lag.half_width_s(CONFIDENCE), lag.standard_error_s)
    )
    told = round(1e3 * told_s, 3)
    return SensorDelay(
        sensor, parameter, told, value, round(value - half, 1), round(value + half, 1), error, lag.samples,
        reach_ms,
    )  # fmt: skip


def read_delays(documents: Iterable[Mapping[str, Any]]) -> tuple[SensorDelay, ...]:
    """Delays as a result file holds them."""
    return tuple(SensorDelay.from_document(one) for one in documents)
