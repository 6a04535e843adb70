"""Check of the estimator's parameters: which are none, which lie outside of their range, which were replaced."""

from __future__ import annotations

import math
from collections.abc import Iterator

from fusetune.px4.flight import Flight, ParameterValue, ReplacedParameter
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS, as_float32
from fusetune.save.checks.check import Check
from fusetune.save.thresholds import VerdictThresholds

_COPY_AGAIN = "Copy the log from the vehicle again; check the SD card"
_NAMED = 5


def parameter_values(flight: Flight, limits: VerdictThresholds) -> Check:
    """Whether the estimator's parameters in the log are known and in their ranges.

    What no vehicle can have flown with was replaced when the flight was brought to the layout of v1.16 (see
    `fusetune.px4.parameters.logged_parameters`); what merely lies outside of its range is replayed as it flew.
    """
    name = "parameter_values"
    own = {key: value for key, value in flight.parameters.at_end().items() if key.startswith("EKF2_")}
    if not own:
        reason = "the log holds no parameters of the estimator: the defaults of the release are replayed"
        return Check(name, "warning", reason, _COPY_AGAIN, 0.0)
    odd = [*map(_replaced, flight.replaced_parameters), *_outside(own)]
    if odd:
        reason = f"{'; '.join(odd[:_NAMED])}{f' and {len(odd) - _NAMED} more' if len(odd) > _NAMED else ''}"
        return Check(name, "warning", reason, "Mend the parameters, or copy the log again", float(len(odd)), 0.0)
    return Check(name, "pass", f"{len(own)} parameters of the estimator are in their ranges", "", 0.0, 0.0)


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
