"""Motor field, hard iron, scale and declination out of the fit of the magnetometer (`magnetic_fit`).

Its terms: c of the motors, h of the body, S of the scale.

PX4 corrects what a sensor measures as rotation · scale · (data + power · COMP − OFF) (`Magnetometer::Correct`), so COMP
falls by c and OFF rises by h, both over the scale.

References
----------
PX4 v1.16, `src/lib/sensor_calibration/Magnetometer.hpp`; parameters CAL_MAGn_XCOMP (G of throttle, G/kA of current),
CAL_MAGn_XOFF (G), CAL_MAGn_XSCALE, CAL_MAG_COMP_TYP, EKF2_MAG_DECL (degrees)
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fusetune.analyze.effects.declination import true_heading_error
from fusetune.analyze.effects.estimate import Effect, Estimate
from fusetune.analyze.effects.magnetic_fit import HARD, MOTOR, SCALE, MagneticFit, fit_magnetic
from fusetune.analyze.effects.motor_power import OFF
from fusetune.analyze.effects.told import refused, told_value
from fusetune.analyze.effects.walking_regression import WalkingFit
from fusetune.analyze.observed.observed_flight import ObservedFlight

LARGEST_FIELD_ERROR_GAUSS = 0.003
"""Standard error of a field above which it is not told: about 1° of heading."""
LARGEST_FIELD_SHARE = 0.05
"""The same, of the field itself: a strong one is told where its interval is within a tenth of it."""
LARGEST_IRON_ERROR_GAUSS = 0.005
LEAST_TURN_DEG = 150.0
"""Of all headings; what is seen from one side is nearly one with the earth's field."""
LARGEST_SCALE_ERROR = 0.04
LARGEST_DECLINATION_ERROR_DEG = 2.0
NORMAL_95 = 1.96
_AXES = "XYZ"


def estimate_magnetic(observed: ObservedFlight) -> tuple[Effect, ...]:
    """Effects `motor_magnetic_field`, `hard_iron`, `magnetometer_scale` and `declination`."""
    found = fit_magnetic(observed)
    if isinstance(found, str):
        return tuple(
            refused(name, found) for name in ("motor_magnetic_field", "hard_iron", "magnetometer_scale", "declination")
        )
    figures = {"noise_gauss": found.fit.noise, "heading_walk_deg_sqrt_s": math.degrees(found.fit.walk)}
    calibration = _Calibration.of(observed)
    return (
        _motor(found, calibration, figures),
        _hard_iron(found, calibration, figures),
        _scale(found, calibration, figures),
        _declination(observed, found),
    )


@dataclass(frozen=True)
class _Calibration:
    """What PX4 is told of the magnetometer: parameters by name, and their prefix; empty where its axes are turned."""

    values: dict[str, float]
    prefix: str

    @classmethod
    def of(cls, observed: ObservedFlight) -> _Calibration:
        logged = observed.logged.parameters.initial
        table = observed.flight.topic("vehicle_magnetometer")
        device = int(table["device_id"][0]) if table is not None and "device_id" in table else 0
        for number in range(4):
            prefix = f"CAL_MAG{number}_"
            rotation = logged.get(f"{prefix}ROT", -1)
            turned = logged.get("SENS_BOARD_ROT", 0) if rotation == -1 else rotation
            same = device and int(logged.get(f"{prefix}ID", 0)) & 0xFFFFFFFF == device & 0xFFFFFFFF
            if same and turned == 0:
                return cls({name: float(value) for name, value in logged.items() if name.startswith(prefix)}, prefix)
        return cls({}, "")

    def told(self, name: str, default: float) -> float:
        return self.values.get(self.prefix + name, default)


def _motor(found: MagneticFit, calibration: _Calibration, figures: dict[str, float]) -> Effect:
    name = "motor_magnetic_field"
    if not found.has_power:
        return refused(
            name, "the log tells neither what the motors draw nor when they stand still: log from boot", **figures
        )
    span = float(np.ptp(np.percentile(found.power.power, [1.0, 99.0])))
    figures = figures | {"power_span": span, "CAL_MAG_COMP_TYP": float(found.power.kind)}
    errors = found.fit.standard_error[MOTOR]
    share = float(np.max(errors)) / max(float(np.linalg.norm(found.fit.constants[MOTOR])), 1e-12)
    if float(np.max(errors)) * span > LARGEST_FIELD_ERROR_GAUSS and share > LARGEST_FIELD_SHARE:
        why = (
            "the field of the motors cannot be told from that of the body; log from boot, stand still for ten seconds"
            " before arming, then hover, climb fast and sink, and turn on the spot"
        )
        return refused(name, why, **figures)
    is_px4 = found.power.kind != OFF and calibration.prefix != ""
    estimates = []
    for axis, letter in enumerate(_AXES):
        index = MOTOR.start + axis
        if is_px4:
            factor, told = -1.0 / calibration.told(f"{letter}SCALE", 1.0), calibration.told(f"{letter}COMP", 0.0)
            label = f"{calibration.prefix}{letter}COMP"
        else:
            factor, told, label = 1.0, 0.0, f"motor_field_{letter.lower()}"
        estimates.append(_shifted(found.fit, index, label, found.power.unit, told, factor, known=is_px4))
    return Effect(name, tuple(estimates), "", figures)


def _shifted(fit: WalkingFit, index: int, name: str, unit: str, told: float, factor: float, *, known: bool) -> Estimate:
    value, half = told + factor * float(fit.constants[index]), abs(factor) * fit.half_width(index)
    error = abs(factor) * float(fit.standard_error[index])
    count = int(fit.residual.size)
    return Estimate(name, unit, told if known else None, value, value - half, value + half, error, count)


def _hard_iron(found: MagneticFit, calibration: _Calibration, figures: dict[str, float]) -> Effect:
    estimates, missing = [], []
    for axis, letter in enumerate(_AXES):
        index = HARD.start + axis
        one_sided = axis < 2 and math.degrees(found.turned) < LEAST_TURN_DEG
        if one_sided or found.fit.standard_error[index] > LARGEST_IRON_ERROR_GAUSS:
            missing.append(letter)
        elif calibration.prefix:
            told, factor = calibration.told(f"{letter}OFF", 0.0), 1.0 / calibration.told(f"{letter}SCALE", 1.0)
            estimates.append(
                _shifted(found.fit, index, f"{calibration.prefix}{letter}OFF", "G", told, factor, known=True)
            )
        else:
            estimates.append(_shifted(found.fit, index, f"hard_iron_{letter.lower()}", "G", 0.0, 1.0, known=False))
    refusal = ""
    if missing:
        refusal = f"hard iron along {', '.join(missing)} not told: turn once on the spot in both directions, tilt far"
    return Effect("hard_iron", tuple(estimates), refusal, figures)


def _scale(found: MagneticFit, calibration: _Calibration, figures: dict[str, float]) -> Effect:
    estimates, missing = [], []
    for axis, letter in enumerate(_AXES):
        index = SCALE.start + axis
        error = float(found.fit.standard_error[index])
        if error > LARGEST_SCALE_ERROR:
            missing.append(letter)
            continue
        told = calibration.told(f"{letter}SCALE", 1.0)
        value, half = 1.0 + float(found.fit.constants[index]), found.fit.half_width(index)
        name = f"{calibration.prefix}{letter}SCALE" if calibration.prefix else f"magnetometer_scale_{letter.lower()}"
        count = int(found.fit.residual.size)
        estimates.append(
            Estimate(
                name, "", told if calibration.prefix else None, told / value, told / (value + half),
                told / max(value - half, 0.1), told * error / value**2, count,
            )
        )  # fmt: skip
    refusal = f"scale along {', '.join(missing)} not told: turn on all headings, tilt far" if missing else ""
    return Effect("magnetometer_scale", tuple(estimates), refusal, figures)


def _declination(observed: ObservedFlight, found: MagneticFit) -> Effect:
    """How far the heading by the magnetometer is from the one that GNSS velocities tell, on the model's declination."""
    name, told = "declination", told_value(dict(observed.parameters), "EKF2_MAG_DECL")
    error = true_heading_error(observed, found.heading, found.time, found.heading_error)
    # a hard iron that is off turns the magnetometer's own heading
    level = found.fit.standard_error[HARD][:2].max() / found.level_gauss
    total = math.inf if error is None else math.hypot(error.standard_error, math.degrees(float(level)))
    if error is None or total > LARGEST_DECLINATION_ERROR_DEG:
        figures = {} if error is None else {"standard_error_deg": total}
        why = (
            "GNSS velocities do not tell the heading; fly straight legs with hard starts and stops, on several headings"
        )
        return refused(name, why, **figures)
    value, half = (
        found.declination_deg + error.value,
        math.hypot(error.half_width, NORMAL_95 * math.degrees(float(level))),
    )
    return Effect(
        name,
        (
            Estimate(
                "EKF2_MAG_DECL", "deg", told, value, value - half, value + half, total, error.n,
            ),
        ),
        "",
        {"world_model_deg": found.declination_deg},
    )  # fmt: skip
