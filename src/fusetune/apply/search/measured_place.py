"""What the flights themselves tell of the GNSS receiver: where its antenna is, and how late it is.

A lever arm shows in the score only on flights that turn hard, and on others luck does; the smoother tells it with an
error of its own (`fusetune.analyze.delays.velocity_place`). So it is set where it is measured to be wrong, and else
left alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fusetune.analyze.delays.pooled_place import pooled_place
from fusetune.analyze.delays.sensor_delays import ARM_PARAMETERS
from fusetune.analyze.delays.velocity_place import VelocityPlace
from fusetune.apply.search.space import Space
from fusetune.px4.aid_sources import SENSORS

_ERRORS = 3.0
"""An axis is wrong where it is measured so many standard errors from what is told: by chance on one of 120 vehicles."""

_LEAST_M = 0.05
"""Nearer to what is told it makes no difference."""

_CERTAIN_S = 0.03
"""A delay whose standard error is larger is not tried for being measured."""

DELAY = SENSORS["gnss"].delay_parameter


def measured_arm(space: Space, told: Mapping[str, float], places: Sequence[VelocityPlace | None]) -> dict[str, float]:
    """Axes of the antenna's place that are measured to be wrong, with the values that they are set to, in centimetres.

    Parameters
    ----------
    space : of those that may be moved
    told : what the vehicle is told
    places : what each flight tells
    """
    pooled = pooled_place(places)
    if pooled is None:
        return {}
    found = {}
    axes = zip(ARM_PARAMETERS["gnss"], pooled.arm.tolist(), pooled.arm_error.tolist(), strict=True)
    for name, value, error in axes:
        if name in space.parameters and abs(value - told[name]) > max(_LEAST_M, _ERRORS * error):
            found[name] = space.values(space.point({**told, name: round(value, 2)}))[name]
    return found


def measured_delay(space: Space, told: Mapping[str, float], places: Sequence[VelocityPlace | None]) -> dict[str, float]:
    """The delay on its grid, if it may be moved and the flights tell it."""
    pooled = pooled_place(places)
    if pooled is None or DELAY not in space.parameters or pooled.delay_error_s > _CERTAIN_S:
        return {}
    return {DELAY: space.values(space.point({**told, DELAY: 1e3 * pooled.delay_s}))[DELAY]}
