"""The parameter record that every kernel takes: one field per EKF2 parameter of the baseline release."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fusetune.ekf2.releases.behaviours import BASELINE, RELEASES
from fusetune.ekf2.releases.by_release import marked
from fusetune.px4.aid_sources import SENSORS
from fusetune.px4.parameters.ekf2_parameters import ALL_PARAMETERS, PARAMETERS, complete

__all__ = ["EKF2_PARAMETERS", "PARAMETER_NAMES", "complete", "parameter_record", "parameters_beside"]

PARAMETER_NAMES = tuple(sorted(PARAMETERS))

EKF2_PARAMETERS = np.dtype([(name, "f8") for name in PARAMETER_NAMES])
"""All fields are float64, whole numbers too, so that one value can be set through a flat view of the record."""

_NEW_PARAMETERS: Mapping[str, tuple[str, ...]] = {"v1.17": ("EKF2_GPS_MODE", "EKF2_REQ_FIX")}
"""Parameters that the baseline release does not have, and the releases since which the estimator reads them."""

OBSOLETE_MAG_TYPE_DEFAULT = 0
VALID_MAG_TYPES = (0, 1, 5, 6)
DELAY_PARAMETERS = tuple(sensor.delay_parameter for sensor in SENSORS.values() if sensor.buffered)
"""Delays that EKF2_DELAY_MAX, which sizes the buffers, must not fall short of."""


def taken_value(name: str, value: float) -> float:
    """A parameter's value as PX4 takes it, at start and whenever it changes: an obsolete EKF2_MAG_TYPE is replaced."""
    if name == "EKF2_MAG_TYPE" and value not in VALID_MAG_TYPES:
        return float(OBSOLETE_MAG_TYPE_DEFAULT)
    return value


def parameters_beside(release: str) -> tuple[str, ...]:
    """Parameters that the estimator of a release reads beside those of the baseline release."""
    place = RELEASES.index(release)
    return tuple(name for since, names in _NEW_PARAMETERS.items() if RELEASES.index(since) <= place for name in names)


def parameter_record(values: Mapping[str, float], release: str = BASELINE) -> np.ndarray:
    """One-element array of EKF2_PARAMETERS from a complete set, with the corrections PX4 makes at start.

    In the record of another release those that `parameters_beside` names follow, with their defaults where the set
    has none. PX4 replaces obsolete values of EKF2_MAG_TYPE and raises EKF2_DELAY_MAX to the longest sensor delay.

    Raises
    ------
    KeyError
        A parameter of the baseline release is missing.
    """
    beside = parameters_beside(release)
    record = np.zeros(1, marked(np.dtype([(name, "f8") for name in (*PARAMETER_NAMES, *beside)]), release))
    for name in beside:
        record[name] = values.get(name, ALL_PARAMETERS[name].default)
    for name in PARAMETER_NAMES:
        record[name] = taken_value(name, values[name])
    record["EKF2_DELAY_MAX"] = max(values[name] for name in ("EKF2_DELAY_MAX", *DELAY_PARAMETERS))
    return record
