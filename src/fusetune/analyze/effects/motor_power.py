"""What the motors draw over a flight, by what the log has: battery current, throttle, or the thrust that is felt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.flight.throttle import ASKED, FEWEST_ROWS, throttle
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.ekf2.numerics.constants import ONE_G
from fusetune.px4.flight import row_count

Array = npt.NDArray[np.float64]

OFF, THROTTLE, CURRENT = 0, 1, 2
"""Values of CAL_MAG_COMP_TYP; the current is that of battery 0."""
ARMED = 2
_LEAST_RATE_HZ = 2.0
_LEAST_CHANGES = {CURRENT: 1e-3, THROTTLE: 0.05}
"""kA, and share of full throttle."""
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
    for kind, unit, drawn in (
        (CURRENT, "G/kA", _current(observed)),
        (THROTTLE, "G", throttle(observed.flight, ASKED) or throttle(observed.logged, ASKED)),
    ):
        if drawn is None:
            continue
        stamp, values = drawn[:2]
        rate_hz = (stamp.size - 1) / max((stamp[-1] - stamp[0]) * 1e-6, 1e-6)
        if rate_hz < _LEAST_RATE_HZ or np.ptp(values) < _LEAST_CHANGES[kind]:
            continue
        power = np.interp(time, stamp, values)
        known = (time >= stamp[0] - 1_000_000) & (time <= stamp[-1] + 1_000_000)
        return MotorPower(kind, unit, np.where(known, power, np.nan))
    return MotorPower(OFF, "G", _thrust(observed, time))


def _current(observed: ObservedFlight) -> tuple[npt.NDArray[np.int64], Array] | None:
    """Times, µs, and current, kA, of battery 0."""
    table = observed.flight.topic("battery_status") or observed.logged.topic("battery_status")
    if table is None or "current_a" not in table or row_count(table) < FEWEST_ROWS:
        return None
    return table["timestamp"].astype(np.int64), 1e-3 * np.nan_to_num(np.asarray(table["current_a"], np.float64))


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
