"""A parameter, or a state of the filter, at a bound of its range."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusetune.analyze.diagnosis.causes.claim import diagnosed
from fusetune.analyze.diagnosis.diagnosis import Diagnosis, Sign
from fusetune.analyze.diagnosis.signs import Signs
from fusetune.analyze.flight.intervals import inside

AT_LIMIT, SHARE_FROM = 0.98, 0.1
SHAKEN = ("EKF2_ACC_NOISE", "EKF2_GYR_NOISE")
"""At the most that PX4 takes these are what a comparison of sets chooses for a frame that shakes."""


def diagnose(signs: Signs) -> Diagnosis | None:
    """By what is set, and by how long the accelerometer's bias stood at EKF2_ABL_LIM."""
    found = [
        Sign(
            f"{one.parameter} is {one.value:g}, the {'least' if one.is_low else 'most'} that PX4 takes (default "
            f"{one.default:g})",
            2.0,
            1.0,
            "",
        )
        for one in signs.at_limits
    ]
    names = [one.parameter for one in signs.at_limits]
    shaken = [one.parameter for one in signs.at_limits if one.parameter in SHAKEN and not one.is_low]
    values = {one.parameter: one.default for one in signs.at_limits if one.parameter not in shaken}
    share = _bias_at_limit(signs)
    if share > SHARE_FROM:
        found.append(
            Sign(
                f"the accelerometer's bias stands at EKF2_ABL_LIM for {share:.0%} of the flight",
                share,
                SHARE_FROM,
                "1",
                "replay",
            )
        )
    if not found:
        return None
    return diagnosed(
        signs,
        "parameter_at_limit",
        _title(names),
        "warning",
        0.9 if names else 0.7,
        found,
        values=values,
        remedy=_remedy(names, shaken),
    )


def _title(names: Sequence[str]) -> str:
    if not names:
        return "A state stands at its limit"
    several = len(names) > 1
    return f"{' and '.join(names)} stand{'' if several else 's'} at {'bounds' if several else 'a bound'} of the range"


def _remedy(names: Sequence[str], shaken: Sequence[str]) -> str:
    if not names:
        return "Calibrate the accelerometer; if it comes back, look for vibration. Do not raise EKF2_ABL_LIM"
    told = []
    if shaken:
        told.append(
            f"Where a comparison of sets chose {' and '.join(shaken)}, the frame shakes as much as EKF2 can be told or "
            "more: balance the propellers and look at how the autopilot is mounted"
        )
    if len(shaken) < len(names):
        told.append(
            "Find out why it was set there: what it was to hide is seldom cured by it. Start again from the default"
        )
    return ". ".join(told)


def _bias_at_limit(signs: Signs) -> float:
    limit = signs.parameters.get("EKF2_ABL_LIM", 0.4)
    if not signs.is_replayed or signs.observed.replayed.steps is None or limit <= 0.0:
        return 0.0
    steps = signs.observed.replayed.steps()
    bias = np.abs(steps.accel_bias[inside(steps.time, signs.airborne)])
    return float(np.mean((bias > AT_LIMIT * limit).any(axis=1))) if len(bias) else 0.0
