"""What the flights themselves tell of the GNSS receiver: how late it is, and where its antenna sits.

A delay or a lever arm shows in the score only on flights that move hard, and on others luck does; the smoother tells
both with errors of their own (`fusetune.analyze.delays.velocity_place`). So each is set where it is measured to be
wrong, and else left alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fusetune.analyze.delays.pooled_place import pooled_place
from fusetune.analyze.delays.velocity_place import VelocityPlace
from fusetune.apply.search.space import Space
from fusetune.design.tunable_parameters import ARM_PARAMETERS
from fusetune.px4.aid_sources import SENSORS

_ERRORS = 3.0
"""It is wrong where it is measured so many standard errors from what is told: by chance, of the four, on one vehicle in
90."""

_LEAST_M, _LEAST_MS = 0.05, 10.0
"""Nearer to what is told it makes no difference: EKF2 acts on delays in steps of 10 ms."""

DELAY, ARM = SENSORS["gnss"].delay_parameter, ARM_PARAMETERS["gnss"]


def measured_values(
    space: Space, told: Mapping[str, float], places: Sequence[VelocityPlace | None]
) -> list[dict[str, float]]:
    """What is measured to be wrong, with the values to set: delay and axes together, then each of the two alone.

    Parameters
    ----------
    space : of those that may be moved
    told : what the vehicle is told
    places : what each flight tells
    """
    pooled = pooled_place(places)
    if pooled is None:
        return []
    delay = {DELAY: (1e3 * pooled.delay_s, 1e3 * pooled.delay_error_s)}
    arm = dict(zip(ARM, zip(pooled.arm.tolist(), pooled.arm_error.tolist(), strict=True), strict=True))
    late, off = _wrong(space, told, delay, _LEAST_MS, 0), _wrong(space, told, arm, _LEAST_M, 2)
    return [one for one in ([late | off, late, off] if late and off else [late | off]) if one]


def _wrong(
    space: Space, told: Mapping[str, float], measured: Mapping[str, tuple[float, float]], least: float, digits: int
) -> dict[str, float]:
    return {
        name: space.values(space.point({**told, name: round(value, digits)}))[name]
        for name, (value, error) in measured.items()
        if name in space.parameters and abs(value - told[name]) > max(least, _ERRORS * error)
    }
