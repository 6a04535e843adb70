"""The parameter record that every kernel takes: one field per EKF2 parameter of the baseline release."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fusetune.ekf2.releases.behaviours import BASELINE, RELEASES
from fusetune.ekf2.releases.by_release import marked
from fusetune.px4 import releases
from fusetune.px4.aid_sources import SENSORS
from fusetune.px4.parameters.complete_sets import complete
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS, defaults_of
from fusetune.px4.releases import estimator_name, number_of_name

__all__ = ["EKF2_PARAMETERS", "PARAMETER_NAMES", "complete", "parameter_record", "parameters_beside"]

PARAMETER_NAMES = tuple(sorted(PARAMETERS))

EKF2_PARAMETERS = np.dtype([(name, "f8") for name in PARAMETER_NAMES])
"""All fields are float64, whole numbers too, so that one value can be set through a flat view of the record."""

_OTHER_PARAMETERS: Mapping[tuple[str, str], tuple[str, ...]] = {
    ("v1.13", "v1.13"): ("EKF2_AID_MASK", "EKF2_HGT_MODE", "EKF2_RNG_AID", "EKF2_WIND_NOISE"),
    ("v1.13", "v1.14"): ("EKF2_MAG_YAWLIM", "SENS_BARO_RATE", "SENS_MAG_RATE"),
    ("v1.13", "v1.15"): ("EKF2_TERR_MASK",),
    ("v1.17", RELEASES[-1]): ("EKF2_GPS_MODE", "EKF2_REQ_FIX"),
}
"""Parameters that the baseline release does not have, by the first and the last release whose estimator reads them."""

OBSOLETE_MAG_TYPE_DEFAULT = 0
MAG_TYPES_GIVEN_UP = estimator_name(releases.MAG_TYPES_GIVEN_UP)
VALID_MAG_TYPES = (0, 1, 5, 6)
DELAY_PARAMETERS = tuple(sensor.delay_parameter for sensor in SENSORS.values() if sensor.buffered)
"""Delays that EKF2_DELAY_MAX, which sizes the buffers, must not fall short of."""


def taken_value(name: str, value: float, release: str = BASELINE) -> float:
    """A parameter's value as PX4 takes it, at start and whenever it changes.

    Since v1.15 an EKF2_MAG_TYPE that was given up is replaced.
    """
    keeps = RELEASES.index(release) < RELEASES.index(MAG_TYPES_GIVEN_UP)
    if name == "EKF2_MAG_TYPE" and value not in VALID_MAG_TYPES and not keeps:
        return float(OBSOLETE_MAG_TYPE_DEFAULT)
    return value


def parameters_beside(release: str) -> tuple[str, ...]:
    """Parameters that the estimator of a release reads beside those of the baseline release."""
    place = RELEASES.index(release)
    return tuple(
        name
        for (since, until), names in _OTHER_PARAMETERS.items()
        if RELEASES.index(since) <= place <= RELEASES.index(until)
        for name in names
    )


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
    defaults = defaults_of(number_of_name(release))
    for name in beside:
        record[name] = values[name] if name in values else defaults[name]
    for name in PARAMETER_NAMES:
        record[name] = taken_value(name, values[name], release)
    record["EKF2_DELAY_MAX"] = max(values[name] for name in ("EKF2_DELAY_MAX", *DELAY_PARAMETERS))
    return record
