"""What could be wrong with a magnetometer, each held against its readings: which of them leaves least.

The earth's field at the place is known (world magnetic model), the attitude from gyros and level, the heading from GNSS
or, without it, from the fit itself. What the readings differ by is explained in turn by a field of the body, one in
step with the thrust, wrong scales, another mounting, or a field of the place that comes and goes; causes that look
alike in the size of the innovations differ in what they leave.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from fusetune.save.checks.magnetometer_mounting import QUARTER_TURNS

Array = npt.NDArray[np.float64]

SMOOTHED_S = 0.5
"""Readings are averaged over so long: noise is no matter of mounting, and 20 readings a second tell no more."""
_ROUNDS = 3
_EIGHTH_TURNS = tuple(np.radians(angle) for angle in (45.0, 135.0, 225.0, 315.0))


@dataclass(frozen=True)
class FieldFit:
    """Readings under one cause.

    Attributes
    ----------
    left : RMS of what it leaves, of all axes together, Gauss
    values : what was fitted, by name
    turn : (3, 3) mounting, of the cause that is one
    heading : of the gyros' frame under which it was fitted, rad
    """

    left: float
    values: Mapping[str, float] = field(default_factory=dict)
    turn: Array | None = None
    heading: float = 0.0


@dataclass(frozen=True)
class FieldReadings:
    """Averaged readings with the attitude at their time.

    Attributes
    ----------
    time_s : (N,) s
    measured : (N, 3) Gauss, FRD
    rotation : (N, 3, 3) body → frame of the gyros' heading
    thrust : (N,) about 1 in a hover
    """

    time_s: Array
    measured: Array
    rotation: Array
    thrust: Array

    def expected(self, earth: Array, heading: float) -> Array:
        """(N, 3) the earth's field, NED, in the body; `heading` turns the gyros' frame to NED."""
        cosine, sine = np.cos(heading), np.sin(heading)
        in_frame = np.array([cosine * earth[0] + sine * earth[1], -sine * earth[0] + cosine * earth[1], earth[2]])
        return np.asarray(np.einsum("nji,j->ni", self.rotation, in_frame))


def field_fits(readings: FieldReadings, earth: Array, heading: float | None) -> dict[str, FieldFit]:
    """Each cause held against the readings.

    Parameters
    ----------
    earth : (3,) field of the place, NED, Gauss
    heading : of the gyros' frame, rad; None where nothing but the magnetometer tells it

    Returns
    -------
    By cause; `as_told` is none, nor is `own_heading`, under which nothing but the heading is another
    """
    ones = np.ones(readings.time_s.size)
    thrust = readings.thrust - float(np.mean(readings.thrust))
    found = {
        "as_told": _linear(readings, earth, heading, []),
        "own_heading": _linear(readings, earth, None, []),
        "body_field": _linear(readings, earth, heading, [("body_field", ones)]),
        "motor_field": _linear(readings, earth, heading, [("body_field", ones), ("motor_field", thrust)]),
        "scale": _scales(readings, earth, heading),
        "one_scale": _scales(readings, earth, heading, alike=True),
    }
    found["mounting"] = _mounting(readings, earth, heading)
    return found


def _best_heading(readings: FieldReadings, earth: Array, left: Array, start: float) -> float:
    """The heading at which the expected field is nearest to what is left for it, (N, 3)."""
    in_frame = np.einsum("nij,nj->ni", readings.rotation, left).mean(axis=0)
    if np.hypot(in_frame[0], in_frame[1]) < 1e-3 or np.hypot(earth[0], earth[1]) < 1e-3:
        return start
    return float(np.arctan2(earth[1], earth[0]) - np.arctan2(in_frame[1], in_frame[0]))


def _linear(readings: FieldReadings, earth: Array, heading: float | None, terms: list[tuple[str, Array]]) -> FieldFit:
    """Fields of the body that are each a vector times a course."""
    course = np.column_stack([one for _, one in terms]) if terms else np.zeros((readings.time_s.size, 0))
    at = _best_heading(readings, earth, readings.measured, 0.0) if heading is None else heading
    factors: Array = np.zeros((course.shape[1], 3))
    for _ in range(_ROUNDS if heading is None else 1):
        expected = readings.expected(earth, at)
        if terms:
            factors = np.asarray(np.linalg.lstsq(course, readings.measured - expected, rcond=None)[0])
        if heading is None:
            at = _best_heading(readings, earth, readings.measured - course @ factors, at)
    left = readings.measured - readings.expected(earth, at) - course @ factors
    values = {
        f"{name}_{axis}": float(one)
        for (name, _), row in zip(terms, factors, strict=True)
        for axis, one in zip("xyz", row, strict=True)
    }
    return FieldFit(_rms(left), values, None, at)


def _scales(readings: FieldReadings, earth: Array, heading: float | None, *, alike: bool = False) -> FieldFit:
    """Each axis, or all alike, times a factor."""
    at = _best_heading(readings, earth, readings.measured, 0.0) if heading is None else heading
    scale = np.ones(3)
    for _ in range(_ROUNDS if heading is None else 1):
        expected = readings.expected(earth, at)
        product, square = np.sum(readings.measured * expected, axis=0), np.sum(expected**2, axis=0)
        scale = np.full(3, product.sum() / square.sum()) if alike else product / np.maximum(square, 1e-9)
        if heading is None:
            at = _best_heading(readings, earth, readings.measured / np.where(np.abs(scale) > 0.1, scale, 1.0), at)
    left = readings.measured - readings.expected(earth, at) * scale
    return FieldFit(_rms(left), {f"scale_{axis}": float(one) for axis, one in zip("xyz", scale, strict=True)}, None, at)


def turns() -> list[Array]:
    """Mountings that are not as told: quarter turns about any axes, eighth turns about the vertical."""
    found = [one for one in QUARTER_TURNS if not np.allclose(one, np.eye(3))]
    for angle in _EIGHTH_TURNS:
        cosine, sine = np.cos(angle), np.sin(angle)
        found.append(np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]))
    return found


def _mounting(readings: FieldReadings, earth: Array, heading: float | None) -> FieldFit:
    """The mounting that leaves least; where no heading is known turns about the vertical are none."""
    best = FieldFit(np.inf)
    expected = readings.expected(earth, heading) if heading is not None else None
    for turn in turns():
        turned = readings.measured @ turn
        if expected is None:
            if np.allclose(turn[2], [0.0, 0.0, 1.0]):
                continue
            of_turn = readings.expected(earth, _best_heading(readings, earth, turned, 0.0))
        else:
            of_turn = expected
        left = _rms(turned - of_turn)
        if left < best.left:
            best = FieldFit(left, {}, turn)
    return best


def _rms(left: Array) -> float:
    return float(np.sqrt(np.mean(np.square(left)))) if left.size else 0.0
