"""The parameter record that every kernel takes: one field per EKF2 parameter of the baseline release."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fusetune.px4.aid_sources import SENSORS
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS, complete

__all__ = ["EKF2_PARAMETERS", "PARAMETER_NAMES", "complete", "parameter_record"]

PARAMETER_NAMES = tuple(sorted(PARAMETERS))

EKF2_PARAMETERS = np.dtype([(name, "f8") for name in PARAMETER_NAMES])
"""All fields are float64, whole numbers too, so that one value can be set through a flat view of the record."""

OBSOLETE_MAG_TYPE_DEFAULT = 0
VALID_MAG_TYPES = (0, 1, 5, 6)
DELAY_PARAMETERS = tuple(sensor.delay_parameter for sensor in SENSORS.values() if sensor.buffered)
"""Delays that EKF2_DELAY_MAX, which sizes the buffers, must not fall short of."""


def taken_value(name: str, value: float) -> float:
    """A parameter's value as PX4 takes it, at start and whenever it changes: an obsolete EKF2_MAG_TYPE is replaced."""
    if name == "EKF2_MAG_TYPE" and value not in VALID_MAG_TYPES:
        return float(OBSOLETE_MAG_TYPE_DEFAULT)
    return value


def parameter_record(values: Mapping[str, float]) -> np.ndarray:
    """One-element array of EKF2_PARAMETERS from a complete set, with the corrections PX4 makes at start.

    PX4 replaces obsolete values of EKF2_MAG_TYPE and raises EKF2_DELAY_MAX to the longest sensor delay.

    Raises
    ------
    KeyError
        A parameter of the baseline release is missing.
    """
    record = np.zeros(1, EKF2_PARAMETERS)
    for name in PARAMETER_NAMES:
        record[name] = taken_value(name, values[name])
    record["EKF2_DELAY_MAX"] = max(values[name] for name in ("EKF2_DELAY_MAX", *DELAY_PARAMETERS))
    return record
