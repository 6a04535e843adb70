"""What the motors draw over a flight, by what the log has: battery current, throttle, or the thrust that is felt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.ekf2.numerics.constants import ONE_G

Array = npt.NDArray[np.float64]

OFF, THROTTLE, CURRENT = 0, 1, 2
"""Values of CAL_MAG_COMP_TYP; the current is that of battery 0."""
ARMED = 2
_LEAST_RATE_HZ = 2.0
_LEAST_CHANGE_A = 1.0
_THRUST_UNSURE_S = 2.0


@dataclass(frozen=True)
class MotorPower:
    """Power in the unit that PX4 compensates with.

    Attributes
    ----------
    kind : value for CAL_MAG_COMP_TYP that takes it; `OFF` of a thrust that PX4 does not know
    unit : of a coefficient on it
    power : (N,) kA, share of full throttle, or thrust over weight; NaN where it is not known
    """

    kind: int
    unit: str
    power: Array


def motor_power(observed: ObservedFlight, time: npt.NDArray[np.int64]) -> MotorPower:
    """At times (N,), µs."""
    for kind, unit, topic, column, factor in (
        (CURRENT, "G/kA", "battery_status", "current_a", 1e-3),
        (THROTTLE, "G", "vehicle_thrust_setpoint", "xyz[2]", -1.0),
        (THROTTLE, "G", "actuator_controls_0", "control[3]", 1.0),
    ):
        table = observed.flight.topic(topic) or observed.logged.topic(topic)
        if table is None or column not in table or table["timestamp"].size < 10:
            continue
        stamp = table["timestamp"].astype(np.int64)
        values = np.nan_to_num(np.asarray(table[column], np.float64)) * factor
        rate_hz = (stamp.size - 1) / max((stamp[-1] - stamp[0]) * 1e-6, 1e-6)
        change = _LEAST_CHANGE_A * 1e-3 if kind == CURRENT else 0.05
        if rate_hz < _LEAST_RATE_HZ or np.ptp(values) < change:
            continue
        power = np.interp(time, stamp, values)
        known = (time >= stamp[0] - 1_000_000) & (time <= stamp[-1] + 1_000_000)
        return MotorPower(kind, unit, np.where(known, power, np.nan))
    return MotorPower(OFF, "G", _thrust(observed, time))


def _thrust(observed: ObservedFlight, time: npt.NDArray[np.int64]) -> Array:
    """Thrust over weight in the air, 0 before arming and after disarming; between, nothing is known of it."""
    motion, power = observed.motion, np.full(time.size, np.nan)
    if motion is None:
        return power
    flies = inside(
        time, [(a + round(_THRUST_UNSURE_S * 5e5), b - round(_THRUST_UNSURE_S * 1e6)) for a, b in observed.airborne]
    )
    flies &= motion.covers(time)
    power[flies] = motion.at(time, -motion.specific_force[:, 2:])[flies, 0] / ONE_G
    status = observed.flight.topic("vehicle_status")
    if status is not None and "arming_state" in status:
        stamp = status["timestamp"].astype(np.int64)
        armed = status["arming_state"] == ARMED
        row = np.clip(np.searchsorted(stamp, time, side="right") - 1, 0, stamp.size - 1)
        # a message later is still the state before, at most until the next one
        later = np.clip(row + 1, 0, stamp.size - 1)
        power[~armed[row] & ~armed[later] & ~inside(time, observed.airborne)] = 0.0
    return power
