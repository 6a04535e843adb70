"""Estimates out of a fit, and words that several tuners use."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.walking_regression import WalkingFit
from fusetune.analyze.observed.observed_flight import ObservedFlight
from fusetune.ekf2.feed.message_samples import baro_samples

Array = npt.NDArray[np.float64]

NO_MOTION = (
    "the replay gives no motion to compare with: the log needs `sensor_combined` at full rate and a filter that"
    " aligns; log with SDLOG_PROFILE bit 1 from boot"
)


def estimate_of(fit: WalkingFit, index: int, name: str, unit: str, told: float | None, factor: float = 1.0) -> Estimate:
    """A constant of a fit, times a factor, with its 95 % interval."""
    value, half = factor * float(fit.constants[index]), abs(factor) * fit.half_width(index)
    error = abs(factor) * float(fit.standard_error[index])
    return Estimate(name, unit, told, value, value - half, value + half, error, int(fit.residual.size))


def told_value(parameters: Mapping[str, object], name: str) -> float | None:
    """What a log tells of a parameter; None where it does not."""
    value = parameters.get(name)
    return float(value) if isinstance(value, int | float) else None


def refused(effect: str, why: str, **figures: float) -> Effect:
    """An effect that the flight does not tell."""
    return Effect(effect, (), why, figures)


LARGEST_REPEATED_SHARE = 0.95
"""Of messages; noise moves every sample of a sensor that measures."""


def stands_still(values: Array) -> bool:
    """Whether a sensor, (N,) or (N, D), repeats one value, or tells hardly any."""
    if values.shape[0] < 2:
        return True
    repeated = np.diff(values, axis=0) == 0.0
    repeated = repeated if repeated.ndim == 1 else repeated.all(axis=1)
    return bool(np.mean(repeated) > LARGEST_REPEATED_SHARE)


def barometer_rows(observed: ObservedFlight) -> tuple[npt.NDArray[np.int64], Array] | None:
    """Times of measurement (N,), µs, and altitudes (N,), m, where the motion is known; None without any."""
    table, motion = observed.flight.topic("vehicle_air_data"), observed.motion
    if table is None or motion is None:
        return None
    samples, _ = baro_samples(table)
    time = samples["time_us"] - round(1e3 * observed.parameters.get("EKF2_BARO_DELAY", 0.0))
    usable = np.isfinite(samples["hgt"]) & motion.covers(time)
    time, altitude = time[usable], np.asarray(samples["hgt"][usable], np.float64)
    return None if stands_still(altitude) else (time, altitude)


FIXED_WING = 2
"""`vehicle_status.vehicle_type`."""


def is_fixed_wing(observed: ObservedFlight) -> bool:
    """Whether the vehicle ever flew on its wings."""
    status = observed.flight.topic("vehicle_status")
    return status is not None and "vehicle_type" in status and bool(np.any(status["vehicle_type"] == FIXED_WING))
