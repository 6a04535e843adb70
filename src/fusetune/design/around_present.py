"""Studies around what the vehicle flies: each parameter that its flights exercise, one step up and one down.

Which parameters these are, and from which values they are moved, is known only when the flights have been read. Names
depend on the parameter and the direction alone, so that another flight or factor leaves the other sets as they are.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from fusetune.design.factors import Factor, factors_around
from fusetune.design.parameter_sets import ParameterSet, short_name
from fusetune.design.tunable_parameters import TUNABLE_PARAMETERS
from fusetune.px4.aid_sources import AID_SOURCES, SENSORS, NoiseFloor
from fusetune.px4.parameter_sources import required_sources, switched_off

UP, DOWN = "up", "down"
_DIRECTIONS = {DOWN: -1.0, UP: 1.0}
_DIGITS = 3
"""Significant ones of the values that are tried."""
_LEAST_STEP = 0.5
"""Of a whole one: where the range leaves less, the set would be nearly the present one."""
LEAST_ARM_SPEED_M_S = 0.1
"""Speed that one step of a lever arm makes: less is lost in GNSS velocity's own error (0.05 to 0.3 m/s)."""


@dataclass(frozen=True)
class Exercise:
    """What a flight exercises, as far as its log tells without a replay.

    Attributes
    ----------
    topics : that have messages, in the layout of any release
    parameters : of the estimator, name → value
    reported : field of `vehicle_gps_position` → median accuracy that the receiver reports, in the field's unit
    turning : rate that moves the end of a lever arm along body axis x, y, z, rad/s; of nearly all of the flight
    """

    topics: frozenset[str]
    parameters: Mapping[str, float]
    reported: Mapping[str, float]
    turning: tuple[float, float, float]


@dataclass(frozen=True)
class AroundPresent:
    """The study that some flights lead to.

    Attributes
    ----------
    sets : each differs in one parameter from the present set
    left_out : parameter, or set, → why there is none
    """

    sets: tuple[ParameterSet, ...]
    left_out: dict[str, str]


def study_around(
    present: Mapping[str, float],
    parameters: Sequence[str],
    flights: Sequence[Exercise],
    common: Mapping[str, float] | None = None,
) -> AroundPresent:
    """Sets around what the vehicle flies.

    Parameters
    ----------
    present : all its EKF2 parameters, name → value
    parameters : those that may be varied, of the catalogue
    flights : what is known of each flight of the vehicle
    common : values that every set has beside its own; those in which the logs differ
    """
    sets, left_out = [], {}
    for factor in factors_around(present, parameters):
        why = not_exercised(factor.parameter, flights)
        if why:
            left_out[factor.parameter] = why
            continue
        for direction, coordinate in _DIRECTIONS.items():
            name, value = f"{short_name(factor.parameter)}_{direction}", _stepped(factor, coordinate)
            why = _without_effect(factor, value, flights)
            if why:
                left_out[name] = why
            else:
                described = f"{factor.parameter} {value:g} instead of {factor.origin:.6g}"
                sets.append(ParameterSet(name, {**(common or {}), factor.parameter: value}, described))
    return AroundPresent(tuple(sets), left_out)


def _stepped(factor: Factor, coordinate: float) -> float:
    value = factor.value(coordinate)
    rounded = float(f"{value:.{_DIGITS}g}")
    return rounded if factor.low <= rounded <= factor.high else value


def not_exercised(parameter: str, flights: Sequence[Exercise]) -> str:
    """Why a parameter does nothing on any flight, or an empty text."""
    sources = [AID_SOURCES[name] for name in required_sources(parameter) if AID_SOURCES[name].is_replayed]
    reasons: dict[str, None] = {}
    for flight in flights:
        why = [_not_fused(source.name, flight) for source in sources]
        if not all(why) or not sources:
            break
        reasons.update(dict.fromkeys(why))
    else:
        return "; ".join(reasons) or "no flights"
    axis = _axis_of_arm(parameter)
    if axis is not None:
        speed = TUNABLE_PARAMETERS[parameter].facts.step * max(flight.turning[axis] for flight in flights)
        if speed < LEAST_ARM_SPEED_M_S:
            return f"the flights turn too little: a step would make {speed:.2f} m/s"
    return ""


def _not_fused(source: str, flight: Exercise) -> str:
    off = switched_off(source, flight.parameters)
    sensor = AID_SOURCES[source].sensor
    if off or not sensor:
        return off
    names = {name for topic in SENSORS[sensor].topics for name in (topic.name, *topic.made_of)}
    return "" if names & flight.topics else f"no {SENSORS[sensor].label} in the logs"


def _axis_of_arm(parameter: str) -> int | None:
    found = re.fullmatch(r"EKF2_\w+_POS_([XYZ])", parameter)
    return "XYZ".index(found[1]) if found else None


def _without_effect(factor: Factor, value: float, flights: Iterable[Exercise]) -> str:
    if abs(factor.coordinate(value)) < _LEAST_STEP:
        return "its sane range ends there"
    return _below_what_is_reported(factor.parameter, max(value, factor.origin), flights)


def _below_what_is_reported(parameter: str, larger: float, flights: Iterable[Exercise]) -> str:
    """Why a floor does nothing between two values, of which the larger one is given: the receiver reports more."""
    reported = [
        (flight.reported[floor.field] / floor.factor if floor.field in flight.reported else 0.0)
        for flight in flights
        for floor in _floors(parameter)
    ]
    if reported and min(reported) >= larger:
        return f"the receiver reports {min(reported):.2g} or more, above the floor"
    return ""


def _floors(parameter: str) -> Iterator[NoiseFloor]:
    return (floor for source in AID_SOURCES.values() for floor in source.noise_floors if floor.parameter == parameter)
