"""Which parameters matter on these flights, which are flat, and which trade off, from the sets that were tried."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from fusetune.apply.sensitivity.curves import Course, course_along
from fusetune.apply.sensitivity.flight_spread import Spread, compared_sets
from fusetune.apply.sensitivity.indices import Indices, indices_of
from fusetune.apply.sensitivity.region import Region, region_of
from fusetune.apply.sensitivity.result import (
    FLAT,
    MATTERS,
    NOT_TOLD,
    UNSURE,
    Curve,
    Ends,
    ParameterSensitivity,
    Sensitivity,
    TriedSet,
)
from fusetune.apply.sensitivity.surface import fit_surface
from fusetune.apply.sensitivity.trade_offs import trade_offs
from fusetune.apply.trials import Trials
from fusetune.design.factors import Factor

Array = npt.NDArray[np.float64]

SMALLEST = math.log1p(0.01)
"""Nat. Changes of the prediction errors by less than 1 % do not matter."""

LARGEST_SAME = math.log1p(0.03)
"""Nat. Values whose errors differ by more do not count as the same, however large the standard error is."""

LARGEST_FLAT = math.log1p(0.05)
"""Nat. Where larger changes are possible nothing is called flat, however small the mean change is."""

TOLD = 0.75
"""Share of what could be along a parameter that the sets must tell, for anything to be said of it."""


def sensitivity(
    trials: Trials, incumbent: Sequence[float] | None = None, *, confidence: float = 0.95, seed: int = 0
) -> Sensitivity:
    """What trials tell of their factors.

    Parameters
    ----------
    incumbent : (P,) values around which the others are held, as of the set that was found or chosen; by default the
        present ones

    Notes
    -----
    The intervals hold what flights differ by and what the surface leaves open (docs/sensitivity.md).
    """
    present = [factor.origin for factor in trials.factors]
    values = present if incumbent is None else [float(value) for value in incumbent]
    centre = np.array([factor.coordinate(value) for factor, value in zip(trials.factors, values, strict=True)])
    region = region_of(trials, centre)
    surface = fit_surface(trials)
    flights, tried = len(trials.flights), _tried_sets(trials)
    if surface is None:
        silent = tuple(_not_told(trials, region, index, 0.0) for index in range(len(trials.factors)))
        return Sensitivity(flights, confidence, None, None, silent, (), tried)
    compared = compared_sets(trials)
    courses = [course_along(surface, region, index, compared, confidence) for index in range(len(trials.factors))]
    told = np.array([course.resolution >= TOLD for course in courses])
    indices = indices_of(surface, region, told, confidence, seed)
    parameters = tuple(
        _parameter(trials, region, index, course, indices)
        if told[index]
        else _not_told(trials, region, index, course.resolution)
        for index, course in enumerate(courses)
    )
    pairs = trade_offs(trials, surface, region, told, SMALLEST, confidence)
    return Sensitivity(
        flights, confidence, surface.quality, indices.spread if indices else None, parameters, pairs, tried
    )


def _tried_sets(trials: Trials) -> tuple[TriedSet, ...]:
    found = []
    for name, values, differences, allowed in zip(
        trials.names, trials.values.tolist(), trials.differences, trials.allowed, strict=True
    ):
        known = differences[np.isfinite(differences)]
        if known.size:
            found.append(TriedSet(name, tuple(values), float(known.mean()), bool(allowed.all())))
    return tuple(found)


def _not_told(trials: Trials, region: Region, index: int, resolution: float) -> ParameterSensitivity:
    factor = trials.factors[index]
    now, ends = _value(factor, region.centre[index]), _ends(factor, region, index)
    nothing = (None, False, 0.0, None, resolution, None, None, None, None, None)
    return ParameterSensitivity(factor.parameter, factor.scale, factor.origin, now, ends, NOT_TOLD, *nothing)


def _parameter(
    trials: Trials, region: Region, index: int, course: Course, indices: Indices | None
) -> ParameterSensitivity:
    factor = trials.factors[index]
    near = (course.coordinates >= region.near_low[index] - 1e-9) & (
        course.coordinates <= region.near_high[index] + 1e-9
    )
    return ParameterSensitivity(
        parameter=factor.parameter,
        scale=factor.scale,
        present=factor.origin,
        incumbent=_value(factor, region.centre[index]),
        tried=_ends(factor, region, index),
        verdict=_verdict(course, near),
        same_within=_same_within(factor, course, region.centre[index]),
        at_bound=_is_at_bound(course),
        change=float(np.abs(course.to_centre.mean[near]).max(initial=0.0)),
        possible=_possible(course.to_centre, near),
        resolution=course.resolution,
        first=_index(indices.first[index]) if indices else None,
        total=_index(indices.total[index]) if indices else None,
        first_interval=_interval(indices.first_interval[index]) if indices else None,
        total_interval=_interval(indices.total_interval[index]) if indices else None,
        curve=_curve(factor, course),
    )


def _verdict(course: Course, near: npt.NDArray[np.bool_]) -> str:
    change = course.to_centre
    possible = _possible(change, near)
    if possible is None:
        return UNSURE
    if np.any((change.lower[near] > SMALLEST) | (change.upper[near] < -SMALLEST)):
        return MATTERS
    return FLAT if np.all(_hardly(change)[near]) and possible < LARGEST_FLAT else UNSURE


def _possible(change: Spread, near: npt.NDArray[np.bool_]) -> float | None:
    """The largest change that the interval holds; None where it is not known."""
    reach = change.reach[near]
    return float(np.max(np.abs(change.mean[near]) + reach, initial=0.0)) if np.isfinite(reach).all() else None


def _hardly(change: Spread) -> npt.NDArray[np.bool_]:
    """Where the score changes by less than 1 % or one standard error, and by less than `LARGEST_SAME`."""
    return np.asarray(np.abs(change.mean) <= np.clip(np.nan_to_num(change.error), SMALLEST, LARGEST_SAME))


def _same_within(factor: Factor, course: Course, centre: float) -> Ends:
    """The connected range around the incumbent in which the score hardly changes."""
    same = _hardly(course.to_centre)
    start = int(np.argmin(np.abs(course.coordinates - centre)))
    low = high = start
    while low > 0 and same[low - 1]:
        low -= 1
    while high < len(same) - 1 and same[high + 1]:
        high += 1
    return _value(factor, course.coordinates[low]), _value(factor, course.coordinates[high])


def _is_at_bound(course: Course) -> bool:
    """Whether the best of the course is at an end that is not the present value, by more than what does not matter."""
    mean = course.to_present
    best = int(np.argmin(mean))
    at_end = best in (0, len(mean) - 1) and not math.isclose(course.coordinates[best], 0.0, abs_tol=1e-9)
    return at_end and float(np.ptp(mean)) > SMALLEST


def _curve(factor: Factor, course: Course) -> Curve:
    change, mean = course.to_centre, course.to_present
    known = np.isfinite(change.reach).all()
    return Curve(
        values=tuple(_value(factor, one) for one in course.coordinates),
        differences=tuple(mean.tolist()),
        lower=tuple((mean - change.reach).tolist()) if known else (),
        upper=tuple((mean + change.reach).tolist()) if known else (),
        others_at_best=tuple(course.others_at_best.tolist()) if course.others_at_best is not None else (),
    )


def _value(factor: Factor, coordinate: float) -> float:
    """Value at a coordinate, which may lie between those of a grid."""
    if factor.scale == "log":
        return float(factor.origin * factor.unit_step**coordinate)
    return float(factor.origin + factor.unit_step * coordinate)


def _ends(factor: Factor, region: Region, index: int) -> Ends:
    return _value(factor, region.low[index]), _value(factor, region.high[index])


def _index(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _interval(ends: Array) -> Ends | None:
    return (float(ends[0]), float(ends[1])) if np.isfinite(ends).all() else None
