"""Parameters of a log as every room may use them: what no vehicle can have flown with is replaced, and told.

PX4 does not hold parameters to their ranges: QGroundControl warns, and what is stored is flown. EKF2 itself limits some
where it uses them (noises, gates, the update interval), as the replay does. So a value somewhat outside of its range is
replayed as it flew. A value that is no number, or orders of magnitude away, is damage of the log; it says nothing of
the true one, not even on which side of the range that lies, so the default takes its place: that of the airframe or
the firmware where the log tells it, else that of the release.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from fusetune.px4.flight import ParameterChange, ParameterHistory, ParameterValue, ReplacedParameter
from fusetune.px4.parameters.ekf2_parameters import (
    ALL_PARAMETERS,
    ParameterMetadata,
    as_float32,
)
from fusetune.px4.releases import BASELINE, Release

_WIDTHS_BEYOND = 99.0
"""How far, in widths of its range, a value may lie outside: two orders of magnitude, for people do relax checks."""

_DELAY_WIDTHS_BEYOND = 1.0
"""Of delays: EKF2's buffers hold 255 updates, 2.55 s, and count longer ones wrongly."""

_HALF_BOUNDED, _UNBOUNDED = 1e6, 1e3
"""Largest size where the range has one end (gates, noises) and none (positions of sensors, m; declination, deg)."""

_LARGEST_INT32 = 2.0**31
_OWN_LIMITS: Mapping[str, tuple[float, float]] = {
    # what EKF2 itself limits the interval to
    "EKF2_PREDICT_US": (1e3, 1e5),
    # the length of buffers
    "EKF2_DELAY_MAX": (0.0, 2e3),
    # ids of devices
    "EKF2_MAGBIAS_ID": (-_LARGEST_INT32, _LARGEST_INT32),
}


class _Beside(NamedTuple):
    """A parameter that is none of EKF2 but read by a room: default, and what PX4 allows."""

    is_whole: bool
    default: float
    low: float
    high: float


_BESIDE: Mapping[str, _Beside] = {
    "ASPD_SCALE_1": _Beside(False, 1.0, 0.5, 2.0),
    "SENS_BARO_RATE": _Beside(False, 20.0, 1.0, 200.0),
    "SENS_MAG_RATE": _Beside(False, 15.0, 1.0, 200.0),
    "SENS_GPS0_DELAY": _Beside(False, 110.0, 0.0, 300.0),
    "SENS_GPS0_OFFX": _Beside(False, 0.0, -_UNBOUNDED, _UNBOUNDED),
    "SENS_GPS0_OFFY": _Beside(False, 0.0, -_UNBOUNDED, _UNBOUNDED),
    "SENS_GPS0_OFFZ": _Beside(False, 0.0, -_UNBOUNDED, _UNBOUNDED),
    "SDLOG_PROFILE": _Beside(True, 1.0, 0.0, 4095.0),
    "SDLOG_MODE": _Beside(True, 0.0, 0.0, 4.0),
}


def checked_history(
    history: ParameterHistory, release: Release | None
) -> tuple[ParameterHistory, tuple[ReplacedParameter, ...]]:
    """The parameters of a log with every value that a room reads sound and of its type.

    Parameters
    ----------
    history : as logged; it is not changed
    release : that flew, whose defaults count where the log tells none; None where unknown (the baseline's)

    Returns
    -------
    tuple
        The checked parameters, without changes in flight to what cannot be, and what was replaced.
    """
    replaced: list[ReplacedParameter] = []
    initial = dict(history.initial)
    for name, value in history.initial.items():
        if not is_read(name):
            continue
        sound = typed_value(name, value)
        initial[name] = used = _default(name, history, release) if sound is None else sound
        if sound is None:
            replaced.append(ReplacedParameter(name, value, used, None))
    current, changed = dict(initial), []
    for change in history.changed:
        new = typed_value(change.name, change.value) if is_read(change.name) else change.value
        if new is None:
            kept = current.get(change.name, _default(change.name, history, release))
            replaced.append(ReplacedParameter(change.name, change.value, kept, change.timestamp))
            continue
        current[change.name] = new
        changed.append(ParameterChange(change.timestamp, change.name, new))
    return replace(history, initial=initial, changed=changed), tuple(replaced)


def is_read(name: str) -> bool:
    """Whether a room reads the parameter."""
    return name in ALL_PARAMETERS or name in _BESIDE


def typed_value(name: str, value: ParameterValue) -> ParameterValue | None:
    """A value in the type of its parameter; None where no vehicle can have flown with it.

    A file that was converted may hold whole numbers as floats and the other way round, which changes no value.

    Parameters
    ----------
    name : of a parameter that `is_read`
    """
    is_whole = _BESIDE[name].is_whole if name in _BESIDE else ALL_PARAMETERS[name].type == "INT32"
    low, high = flown_limits(name)
    if not math.isfinite(value) or not low <= value <= high or (is_whole and value != int(value)):
        return None
    return int(value) if is_whole else as_float32(float(value))


def flown_limits(name: str) -> tuple[float, float]:
    """Smallest and largest value that a vehicle can have flown with."""
    if name in _OWN_LIMITS:
        return _OWN_LIMITS[name]
    low, high, is_delay = _range(name)
    bounds = [bound for bound in (low, high) if bound is not None]
    if low is not None and high is not None:
        beyond = (_DELAY_WIDTHS_BEYOND if is_delay else _WIDTHS_BEYOND) * (high - low)
        return low - beyond, high + beyond
    largest = max([_HALF_BOUNDED, *map(abs, bounds)]) if bounds else _UNBOUNDED
    return -largest, largest


def _range(name: str) -> tuple[float | None, float | None, bool]:
    """Range in PX4's metadata, with the defaults of older releases, and whether it is that of a delay."""
    if name in _BESIDE:
        return _BESIDE[name].low, _BESIDE[name].high, name.endswith("_DELAY")
    metadata = ALL_PARAMETERS[name]
    low, high = _own_range(metadata)
    defaults = [default for _, default in metadata.default_history]
    return (
        None if low is None else min(low, *defaults),
        None if high is None else max(high, *defaults),
        metadata.unit == "ms",
    )


def _own_range(metadata: ParameterMetadata) -> tuple[float | None, float | None]:
    if metadata.kind == "boolean":
        return 0.0, 1.0
    if metadata.kind == "bitmask":
        return 0.0, float((1 << max(metadata.values) + 1) - 1)
    if metadata.values:
        return float(min(metadata.values)), float(max(metadata.values))
    return metadata.minimum, metadata.maximum


def _default(name: str, history: ParameterHistory, release: Release | None) -> ParameterValue:
    """What takes the place of a value that cannot be."""
    for defaults in (history.default_current_setup, history.default_system):
        value = typed_value(name, defaults[name]) if name in defaults else None
        if value is not None:
            return value
    if name in _BESIDE:
        default, is_whole = _BESIDE[name].default, _BESIDE[name].is_whole
    else:
        metadata = ALL_PARAMETERS[name]
        default, is_whole = metadata.default_in(release or BASELINE), metadata.type == "INT32"
    return int(default) if is_whole else default
