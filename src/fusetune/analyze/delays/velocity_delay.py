"""The delay of a source of velocity, found together with all that could be taken for it.

The smoothed velocity's model (`fusetune.analyze.smoothing`) runs the inertial solution freely, with the errors of its
attitude and of its biases as unknowns and the noises at their likeliest, whether the receiver's error is white or
wanders. The delay is one more unknown: a measurement that is older by d lies d times the acceleration behind. What the
replayed filter did with the late measurements is taken out there, so nothing of the delay hides in it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusetune.analyze.delays.lag import LARGEST_CHANGE_S, Lag
from fusetune.analyze.flight.intervals import Interval
from fusetune.analyze.replaying.replayed_set import ReplayedSet
from fusetune.analyze.smoothing.linear_smoother import Smoothed
from fusetune.analyze.smoothing.smoothed_velocity import fitted, measured_velocities, stretch_of, stretches_of
from fusetune.analyze.smoothing.velocity_models import DELAY, DELAY_S, horizontal_model

CERTAIN_S = 0.06
"""A flight whose standard error is larger tells nothing: the delay is looked for where the motion is nearly linear."""
_ROUNDS = 4
_STANDS_S = 2e-3
_MANY = 1000
"""Degrees of freedom of a variance that hundreds of measurements give."""


def velocity_delay(record: ReplayedSet, source: str, intervals: Sequence[Interval], told_s: float) -> Lag | None:
    """Delay of a source whose measurements are velocities, NED.

    Parameters
    ----------
    record : replay of any set that fused the source
    intervals : parts of the flight, µs
    told_s : delay that the replay was told

    Returns
    -------
    The delay against the time stamps of the messages; None where the flight does not tell it
    """
    measured = measured_velocities(record, source)
    if record.steps is None or measured is None or not intervals:
        return None
    time, values = measured
    steps = record.steps()
    rows = list(stretches_of(steps.time, intervals, record.reset_times["heading"]))
    # PX4 takes half an update off the time of a sample, so that it is the right one for the mean update that takes it.
    half_update_us = round(0.5 * float(np.median(np.diff(steps.time)))) if steps.time.size > 1 else 0
    later_s = 0.0
    for _ in range(_ROUNDS):
        at = time + half_update_us - round(later_s * 1e6)
        parts = [one for one in (stretch_of(steps.rows(row), at, values, ()) for row in rows) if one is not None]
        if not parts:
            return None
        found = _joined(fitted([horizontal_model(one) for one in parts])[1])
        if found is None:
            return None
        change_s, error_s = found
        later_s += change_s
        if error_s > CERTAIN_S or abs(later_s) > LARGEST_CHANGE_S:
            return None
        if abs(change_s) < max(_STANDS_S, 0.1 * error_s):
            break
    return Lag(told_s + later_s, error_s, _MANY, time.size)


def _joined(courses: Sequence[Smoothed]) -> tuple[float, float] | None:
    """Change of the delay and its standard error, s, without what the model expects of it beforehand."""
    information = moment = 0.0
    for one in courses:
        variance = float(one.constant_covariance[DELAY, DELAY])
        information += 1.0 / variance - 1.0 / DELAY_S**2
        # the model's constant is how much newer a measurement is
        moment -= float(one.constants[DELAY]) / variance
    return (moment / information, information**-0.5) if information > 0.0 else None
