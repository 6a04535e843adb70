"""What a decision changes, in the names of the baseline release."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS


@dataclass(frozen=True)
class ParameterChange:
    """One parameter that the decision changes."""

    name: str
    previous: float
    value: float
    type: Literal["INT32", "FLOAT"]
    unit: str
    reboot_required: bool
    alone: str = ""
    """What it brings alone, in words, where that is known."""


def parameter_changes(
    overrides: Mapping[str, float], previous: Mapping[str, float], alone: Mapping[str, str] | None = None
) -> tuple[ParameterChange, ...]:
    """Parameters of a set whose value differs, as float32, from what the vehicle has now, in order of name.

    `alone` says in words what one brings alone.
    """
    changes = []
    for name, value in sorted(overrides.items()):
        before = previous[name]
        if np.float32(value) != np.float32(before):
            metadata = ALL_PARAMETERS[name]
            told = (alone or {}).get(name, "")
            changes.append(
                ParameterChange(name, before, value, metadata.type, metadata.unit, metadata.reboot_required, told)
            )
    return tuple(changes)
