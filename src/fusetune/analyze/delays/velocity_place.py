"""How late a source of velocity is and where its sensor sits, found together with all that could be taken for it.

The smoothed velocity's model (`fusetune.analyze.smoothing`) runs the inertial solution freely, with the errors of its
attitude and of its biases as unknowns and the noises at their likeliest, whether the receiver's error is white or
wanders. Delay and lever arm are further unknowns: a measurement that is older by d lies d times the acceleration
behind, and one from a place r of the body has R (ω × r) added. What the replayed filter did with the measurements is
taken out there, so nothing of either hides in it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fusetune.analyze.delays.lag import LARGEST_CHANGE_S, Lag
from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.replaying.replayed_set import ReplayedSet, ReplayedSteps
from fusetune.analyze.smoothing.smoothed_velocity import (
    fitted,
    measured_velocities,
    stretch_of,
    stretches_of,
    swing_of,
)
from fusetune.analyze.smoothing.velocity_models import (
    ARM,
    ARM_M,
    DELAY,
    DELAY_S,
    VERTICAL_ARM,
    Stretch,
    horizontal_model,
    vertical_model,
)

Array = npt.NDArray[np.float64]

CERTAIN_S = 0.06
"""A flight whose standard error is larger tells nothing: the delay is looked for where the motion is nearly linear."""
_ROUNDS = 4
_STANDS_S = 2e-3
_ARM_UNCERTAINTY = 1.25
"""Factor on the errors of the place: on 15 simulated flights with known antennas they were 1.1 to 1.4 times what the
model promises."""
_MANY = 1000
"""Degrees of freedom of a variance that hundreds of measurements give."""

_LEAST = 1e-2
"""Information that each is given at the least, 1/s² or 1/m²: an error of 10 s or 10 m."""
_DELAY_AND_ARM = [DELAY, *range(ARM.start, ARM.stop)]


@dataclass(frozen=True, eq=False)
class VelocityPlace:
    """What a flight tells of a source of velocity.

    Attributes
    ----------
    lag : its delay against the time stamps of the messages
    arm : (3,) place of its sensor in the body, forward, right and down of the IMU, m
    arm_covariance : (3, 3) m²; large along axes about which the flight tells nothing
    """

    lag: Lag
    arm: Array
    arm_covariance: Array

    def document(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {
            "delay_s": self.lag.delay_s,
            "standard_error_s": self.lag.standard_error_s,
            "freedom": self.lag.freedom,
            "samples": self.lag.samples,
            "arm_m": self.arm.tolist(),
            "arm_covariance_m2": self.arm_covariance.tolist(),
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> VelocityPlace:
        """Read what `document` made."""
        lag = Lag(*(document[name] for name in ("delay_s", "standard_error_s", "freedom", "samples")))
        return cls(lag, np.array(document["arm_m"]), np.array(document["arm_covariance_m2"]))


def velocity_place(
    record: ReplayedSet, source: str, intervals: Sequence[Interval], told_s: float, told_m: Sequence[float] = (0, 0, 0)
) -> VelocityPlace | None:
    """Delay and lever arm of a source whose measurements are velocities, NED.

    Parameters
    ----------
    record : replay of any set that fused the source
    intervals : parts of the flight, µs
    told_s, told_m : delay and lever arm that the replay was told

    Returns
    -------
    What the flight tells; None where it does not tell the delay
    """
    measured = measured_velocities(record, source)
    if record.steps is None or measured is None or not intervals:
        return None
    steps = record.steps()
    time, values = measured[0], _at_the_sensor(*measured, steps, np.asarray(told_m, float))
    rows = list(stretches_of(steps.time, intervals, record.reset_times["heading"]))
    # PX4 takes half an update off the time of a sample, so that it is the right one for the mean update that takes it.
    half_update_us = round(0.5 * float(np.median(np.diff(steps.time)))) if steps.time.size > 1 else 0
    later_s = 0.0
    parts: list[Stretch] = []
    for _ in range(_ROUNDS):
        # of an hour those of two rounds would be a hundred megabytes more
        parts.clear()
        at = time + half_update_us - round(later_s * 1e6)
        found = (stretch_of(steps.rows(row), at, values, (), swings=True) for row in rows)
        parts += [one for one in found if one is not None]
        if not parts:
            return None
        information, moment = _told_by(parts)
        covariance = np.linalg.inv(information)
        mean, error_s = covariance @ moment, float(covariance[0, 0]) ** 0.5
        # the model's constant is how much newer a measurement is
        change_s = -float(mean[0])
        later_s += change_s
        if not error_s <= CERTAIN_S or abs(later_s) > LARGEST_CHANGE_S:
            return None
        if abs(change_s) < max(_STANDS_S, 0.1 * error_s):
            break
    lag = Lag(told_s + later_s, error_s, _MANY, time.size)
    return VelocityPlace(lag, mean[1:], _ARM_UNCERTAINTY**2 * np.asarray(covariance[1:, 1:], np.float64))


def _at_the_sensor(time: npt.NDArray[np.int64], values: Array, steps: ReplayedSteps, told_m: Array) -> Array:
    """Measured velocities without what the filter took away for the lever arm, with the rate of the update it did."""
    if not told_m.any():
        return values
    rows = np.clip(np.searchsorted(steps.time, time), 0, steps.time.size - 1)
    return values + np.einsum("kij,j->ki", swing_of(steps, rows), told_m)


def _told_by(parts: Sequence[Stretch]) -> tuple[Array, Array]:
    """Information (4, 4) and information times mean (4,) of delay and arm, without what the models expect of them."""
    courses = fitted([horizontal_model(one) for one in parts])[1]
    falls = fitted([vertical_model(*one) for one in zip(parts, courses, strict=True)])[1]
    information, moment = np.zeros((4, 4)), np.zeros(4)
    for course in courses:
        own = np.linalg.inv(course.constant_covariance[np.ix_(_DELAY_AND_ARM, _DELAY_AND_ARM)])
        information += own - np.diag([DELAY_S**-2, *[ARM_M**-2] * 3])
        moment += own @ course.constants[_DELAY_AND_ARM]
    for fall in falls:
        own = np.linalg.inv(fall.constant_covariance[VERTICAL_ARM, VERTICAL_ARM])
        information[1:, 1:] += own - np.eye(3) * ARM_M**-2
        moment[1:] += own @ fall.constants[VERTICAL_ARM]
    # along axes that the flight does not tell what is left over is rounding, of either sign
    return information + _LEAST * np.eye(4), moment
