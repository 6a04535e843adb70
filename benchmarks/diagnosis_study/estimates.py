"""Estimated values against the truth."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from .cases import CALM, HEALTHY
from .verdicts import Told, Verdict

MARGIN = 1.1
"""The guide's: the dead zone is the dip and a tenth."""
MENDS = {"ASPD_SCALE_1": "airspeed_scale", "SENS_FLOW_SCALE": "flow_scale"}
"""Parameters that a reading is multiplied by, and what it is wrong by."""
WITH_VALUE = 0.05
"""Relative errors are of true values that are at least this."""


@dataclass(frozen=True)
class Quantity:
    """One kind of estimate, and how near it should be to the truth.

    Attributes
    ----------
    goal : largest error, in its unit or, where `relative`, over the true value
    groups : on whose flights it is judged, of those with a fault the visible ones
    least : true values below this are not judged; an effect that is not there has no relative error
    """

    name: str
    unit: str
    goal: float
    groups: tuple[str, ...]
    holds: Callable[[str], bool]
    relative: bool = False
    least: float = 0.0


def _starts(*starts: str) -> Callable[[str], bool]:
    return lambda name: name.startswith(starts)


QUANTITIES = (
    Quantity("delay of GNSS", "ms", 10.0, ("gnss_delay",), _starts("EKF2_GPS_DELAY")),
    Quantity("delay of optical flow", "ms", 10.0, ("flow_delay",), _starts("EKF2_OF_DELAY")),
    Quantity("delay of vision", "ms", 10.0, ("vision_delay",), _starts("EKF2_EV_DELAY")),
    Quantity("lever arm of the GNSS antenna", "m", 0.1, ("gnss_lever_arm",), _starts("EKF2_GPS_POS")),
    Quantity("places of other sensors", "m", 0.1, (HEALTHY,), _starts("EKF2_RNG_POS", "EKF2_OF_POS", "EKF2_EV_POS")),
    Quantity("BCOEF, flown for it in calm air", "%", 0.05, (CALM,), _starts("EKF2_BCOEF"), relative=True),
    Quantity("MCOEF, likewise", "%", 0.05, (CALM,), _starts("EKF2_MCOEF"), relative=True),
    Quantity("BCOEF, any healthy flight", "%", 0.05, (HEALTHY,), _starts("EKF2_BCOEF"), relative=True),
    Quantity("MCOEF, likewise", "%", 0.05, (HEALTHY,), _starts("EKF2_MCOEF"), relative=True),
    Quantity("static pressure", "%", 0.1, ("static_pressure",), _starts("EKF2_PCOEF"), relative=True, least=0.1),
    Quantity("ground effect", "%", 0.2, ("baro_ground_effect",), _starts("EKF2_GND_EFF_DZ"), relative=True, least=1.0),
    Quantity("motor field", "%", 0.1, ("motor_magnetic_field",), _starts("motor_field"), relative=True, least=0.02),
    Quantity("hard iron", "G", 0.02, ("yaw_alignment",), _starts("hard_iron")),
    Quantity("airspeed scale", "%", 0.05, ("airspeed_scale",), _starts("ASPD_SCALE", "airspeed_scale"), relative=True),
    Quantity("flow scale", "%", 0.05, ("flow_scale",), _starts("SENS_FLOW_SCALE", "flow_scale"), relative=True),
    Quantity("vision scale", "%", 0.05, ("vision_scale",), _starts("vision_scale"), relative=True),
)  # fmt: skip


@dataclass(frozen=True)
class Compared:
    """One estimate beside the truth; without an interval `covers` is NaN."""

    error: float
    covers: float


def true_value(verdict: Verdict, name: str, unit: str) -> float | None:
    """Truth of an estimate by its name and unit; None where the study does not know it."""
    truth = verdict.fault["truth"]
    if name in truth:
        return float(truth[name]) * (MARGIN if name == "EKF2_GND_EFF_DZ" else 1.0)
    if name in MENDS:
        return 1.0 / float(truth[MENDS[name]])
    if name.startswith("hard_iron_"):
        return float(truth[f"{name.removesuffix('_gauss')}_gauss"])
    if name.startswith("motor_field_") and not name.endswith("_gauss"):
        # of the field at hover, that the cause tells where the tuner does not, the study knows no truth
        axis = name[len("motor_field_")]
        if unit in ("G/kA", "G/A"):
            return float(truth[f"motor_field_{axis}_gauss_per_a"]) * (1e3 if unit == "G/kA" else 1.0)
        return float(truth[f"motor_field_{axis}_gauss_per_throttle"])
    return None


def compared(quantity: Quantity, verdicts: Iterable[Verdict]) -> tuple[list[Compared], int]:
    """Estimates of a quantity, and how many flights were asked."""
    found, asked = [], 0
    for verdict in verdicts:
        if verdict.group not in quantity.groups or (verdict.injected and not verdict.is_visible):
            continue
        asked += 1
        for one in _estimates(quantity, verdict):
            true = true_value(verdict, one.name, one.unit)
            scale = _scale(quantity, verdict, one, true)
            if true is None or scale is None:
                continue
            covers = float(one.lower <= true <= one.upper) if np.isfinite([one.lower, one.upper]).all() else np.nan
            found.append(Compared(abs(one.value - true) / scale, covers))
    return found, asked


def _scale(quantity: Quantity, verdict: Verdict, one: Told, true: float | None) -> float | None:
    """What an error is relative to; None where the effect is too small. A vector's errors are over its length."""
    if true is None:
        return None
    if not quantity.relative:
        return 1.0
    size = abs(true)
    if one.name.startswith("motor_field_"):
        parts = [
            true_value(verdict, f"motor_field_{axis}{one.name[len('motor_field_x') :]}", one.unit) for axis in "xyz"
        ]
        size = float(np.linalg.norm([part for part in parts if part is not None]))
        throttle = [float(verdict.fault["truth"][f"motor_field_{axis}_gauss_per_throttle"]) for axis in "xyz"]
        return size if float(np.linalg.norm(throttle)) >= quantity.least else None
    return size if size >= max(quantity.least, WITH_VALUE) else None


def _estimates(quantity: Quantity, verdict: Verdict) -> list[Told]:
    """What the tuners told; of quantities that they do not have, the values of the causes that were named."""
    told = [one for one in verdict.told if quantity.holds(one.name)]
    if told:
        return told
    named = [one.values for one in verdict.named if one.id in quantity.groups]
    values = {name: value for one in named for name, value in one.items() if quantity.holds(name)}
    return [Told("diagnosis", name, "", value, np.nan, np.nan) for name, value in values.items()]


def estimates_table(verdicts: Sequence[Verdict]) -> str:
    """Errors and coverage of each quantity."""
    rows = [
        "| value | flights | estimates | median error | 90th percentile | within | of them | interval covers |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for quantity in QUANTITIES:
        found, asked = compared(quantity, verdicts)
        rows.append(f"| {quantity.name} | {asked} | {len(found)} | {_row(quantity, found)} |")
    return "\n".join(rows)


def _row(quantity: Quantity, found: Sequence[Compared]) -> str:
    factor = 100.0 if quantity.relative else 1.0
    goal = f"{factor * quantity.goal:g} {quantity.unit}"
    if not found:
        return f"– | – | {goal} | – | –"
    errors = factor * np.array([one.error for one in found])
    within = np.mean(errors <= factor * quantity.goal)
    covers = np.array([one.covers for one in found])
    covered = f"{100.0 * np.nanmean(covers):.0f} %" if np.isfinite(covers).any() else "–"
    median, most = np.median(errors), np.percentile(errors, 90.0)
    return f"{median:.3g} {quantity.unit} | {most:.3g} {quantity.unit} | {goal} | {100.0 * within:.0f} % | {covered}"
