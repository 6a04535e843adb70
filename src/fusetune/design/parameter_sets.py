"""Parameter sets, and how those are named that people did not name."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ParameterSet:
    """A named set of EKF2 parameters that differ from those of the log."""

    name: str
    overrides: dict[str, float]
    """Parameter name → value; `int` for INT32 parameters."""
    description: str = ""


def short_name(parameter: str) -> str:
    """A parameter as part of the name of a set: EKF2_ACC_NOISE → ``acc_noise``."""
    return parameter.removeprefix("EKF2_").lower()
