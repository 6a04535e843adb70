"""Where the antenna of the GNSS receiver sits: `EKF2_GPS_POS_*`, found with the receiver's delay (`analyze/delays`)."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.told import refused
from fusetune.analyze.observed.observed_flight import ObservedFlight

ID = "gnss_antenna"
MOST_ERROR_M = 0.15
"""An axis with a larger standard error is not told."""
_95_PERCENT = 1.96
_FLY = "hard starts and stops, fast turns on the spot and tilts to all sides, a minute of them"


def estimate_gnss_antenna(observed: ObservedFlight) -> Effect:
    """Place of the antenna in the body, forward, right and down, m."""
    place = observed.gnss_place
    if place is None:
        return refused(ID, f"GNSS velocity does not tell it on this flight; fly {_FLY}")
    errors = np.sqrt(np.diag(place.arm_covariance))
    figures = {f"error_{axis}_m": float(error) for axis, error in zip("xyz", errors, strict=True)}
    estimates = []
    for axis, value, error in zip("XYZ", place.arm.tolist(), errors.tolist(), strict=True):
        if error <= MOST_ERROR_M:
            name, half = f"EKF2_GPS_POS_{axis}", _95_PERCENT * error
            told = observed.parameters.get(name, 0.0)
            estimates.append(Estimate(name, "m", told, value, value - half, value + half, error, place.lag.samples))
    if not estimates:
        return refused(ID, f"the vehicle turns too little to tell it; fly {_FLY}", **figures)
    return Effect(ID, tuple(estimates), "", figures)
