"""Checks of the estimator's parameters: what no vehicle can have flown with, and what was changed in the air."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fusetune.check import check
from fusetune.finding import Finding
from fusetune.px4.flight import ParameterValue, ReplacedParameter
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS, as_float32
from fusetune.save.checks.judged_flight import IN_THE_AIR, JudgedFlight
from fusetune.save.checks.logging_advice import COPY_AGAIN
from fusetune.save.log_facts import is_airborne

_NAMED = 5
_SAVED_BY_EKF2 = ("EKF2_MAG_DECL", "EKF2_MAGBIAS_X", "EKF2_MAGBIAS_Y", "EKF2_MAGBIAS_Z")
"""Parameters that the estimator itself stores."""
_OF_THE_ESTIMATOR = ("EKF2_", "SENS_", "CAL_", "IMU_")


@check()
def parameter_values(judged: JudgedFlight) -> Finding:
    """Whether the estimator's parameters in the log are known and in their ranges.

    What no vehicle can have flown with was replaced when the flight was brought to the layout of v1.16 (see
    `fusetune.px4.parameters.logged_parameters`); what merely lies outside of its range is replayed as it flew.
    """
    own = {key: value for key, value in judged.flight.parameters.at_end().items() if key.startswith("EKF2_")}
    if not own:
        found = "the log holds no parameters of the estimator: the defaults of the release are replayed"
        return parameter_values.warned(found, COPY_AGAIN, 0.0)
    odd = [*map(_replaced, judged.flight.replaced_parameters), *_outside(own)]
    if odd:
        found = f"{'; '.join(odd[:_NAMED])}{f' and {len(odd) - _NAMED} more' if len(odd) > _NAMED else ''}"
        return parameter_values.warned(found, "Mend the parameters, or copy the log again", float(len(odd)), 0.0)
    return parameter_values.passed(f"{len(own)} parameters of the estimator are in their ranges", 0.0, 0.0)


def _replaced(parameter: ReplacedParameter) -> str:
    said = f"{parameter.name} = {parameter.value:g} cannot be"
    if parameter.timestamp is None:
        return f"{said}: replayed with its default {parameter.used:g}"
    return f"{said}: the change in flight is left out, {parameter.used:g} stays"


def _outside(parameters: dict[str, ParameterValue]) -> Iterator[str]:
    for key, value in sorted(parameters.items()):
        facts = ALL_PARAMETERS.get(key)
        if facts is None:
            yield f"{key} is no parameter of a PX4 release"
            continue
        low = -math.inf if facts.minimum is None else as_float32(facts.minimum)
        high = math.inf if facts.maximum is None else as_float32(facts.maximum)
        # defaults of older releases lie outside of what later ones allow
        is_default = value in [default for _, default in facts.default_history]
        if not (low <= value <= high or is_default):
            yield f"{key} = {value:g} is outside {low:g} to {high:g}: replayed as it flew"


@check(topics=IN_THE_AIR)
def parameter_changes(judged: JudgedFlight) -> Finding:
    """Parameters of estimator and sensors that were changed in the air; a replay keeps one set."""
    flight, begin = judged.flight, judged.begin_us
    relevant = [
        change
        for change in flight.parameters.changed
        if change.name.startswith(_OF_THE_ESTIMATOR) and change.name not in _SAVED_BY_EKF2
    ]
    flying = is_airborne(flight, np.array([change.timestamp for change in relevant], np.int64))
    changed = [change for change, in_the_air in zip(relevant, flying, strict=True) if in_the_air]
    if not changed:
        return parameter_changes.passed("no parameter of estimator or sensors changed in flight", 0.0, 0.0)
    said = ", ".join(
        f"{one.name} = {one.value:g} at {(one.timestamp - begin) * 1e-6:.1f} s" for one in changed[:_NAMED]
    )
    found = f"parameters changed in flight ({said}{' …' if len(changed) > _NAMED else ''})"
    return parameter_changes.warned(found, "Change parameters on the ground only", float(len(changed)), 0.0)
