"""Biases of gyro and accelerometer that the filter found, in rad/s and m/s², and how they changed in flight."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import inside
from fusetune.analyze.health.health_row import HealthRow, Origin
from fusetune.analyze.health.judged_health import JudgedHealth
from fusetune.analyze.health.settings import Levels
from fusetune.analyze.health.subject import Subject
from fusetune.px4.flight import Flight
from fusetune.px4.layouts.bias_states import BiasStates, bias_limits

_WARM_UP = "Calibrate the gyro at working temperature, insulate the IMU or let it warm up"
_VIBRATION = "Calibrate the accelerometer; where it moves in flight, look at vibration and clipping"


def bias_rows(
    health: JudgedHealth, biases: BiasStates | None, instance: int, origin: Origin = "vehicle"
) -> Iterator[HealthRow]:
    """Norm of the medians, clear of the ground, change in flight, and time at the limit."""
    limits = health.limits
    subject = Subject("bias", health.name_of("bias", instance), "filter", instance, origin)
    clear = inside(biases.time, health.clear) if biases is not None else np.zeros(0, bool)
    if biases is None or not clear.any():
        yield subject.lacking("gyro", "the biases in flight are not logged")
        return
    flying = inside(biases.time, health.airborne)
    evidence = {"interval_s": biases.interval_s}
    # a replay has the parameters of v1.16, whatever flew
    flew = health.flight if origin == "vehicle" else Flight("replay")
    gyro_limit, accel_limit = bias_limits(flew, instance, health.parameters)
    sensors = (
        ("gyro", biases.gyro, "rad/s", limits.gyro_bias, limits.gyro_bias_change, gyro_limit, _WARM_UP),
        ("accel", biases.accel, "m/s²", limits.accel_bias, np.inf, accel_limit, _VIBRATION),
    )
    for name, values, unit, level, change_level, limit, remedy in sensors:
        medians = np.median(values[clear], axis=0)
        changes = np.ptp(values[flying], axis=0)
        for figure, words, axes, beyond in (
            (name, f"norm of the median {name} bias", medians, level),
            (f"{name}_change", f"change of the {name} bias in flight", changes, change_level),
        ):
            yield subject.judged(
                figure,
                words,
                float(np.linalg.norm(axes)),
                unit,
                Levels(beyond),
                remedy=remedy,
                evidence=evidence | dict(zip("xyz", map(float, axes), strict=True)),
            )
        yield _at_limit(health, subject, name, values[flying], limit, remedy)


def _at_limit(
    health: JudgedHealth, subject: Subject, name: str, values: npt.NDArray[np.float64], limit: float, remedy: str
) -> HealthRow:
    at_limit = np.any(np.abs(values) > health.limits.bias_at_limit * limit, axis=1)
    return subject.judged(
        f"{name}_at_limit_share",
        f"{name} bias at its limit:",
        float(np.mean(at_limit)) if limit > 0.0 else np.nan,
        "",
        Levels(health.limits.bias_at_limit_share),
        remedy=remedy,
        evidence={"limit": limit},
    )
