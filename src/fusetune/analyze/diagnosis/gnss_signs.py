"""What GNSS messages show by themselves: accuracy as reported, fixes lost, jamming, jumps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fusetune.analyze.diagnosis.gnss_motion import FIX_3D
from fusetune.analyze.diagnosis.motion import Motion
from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.ekf2.numerics.constants import RADIUS_OF_EARTH
from fusetune.px4.flight import TopicTable
from fusetune.px4.parameters.ekf2_parameters import PARAMETERS

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

SILENT_S, SILENT_STEPS = 1.5, 4.0
"""So long without a message, and so many of its usual intervals, a receiver is silent."""
LOST_S = 1.0
CLEARLY = 1.2
"""A receiver that is at a limit now and then is as good as PX4 asks for, one that fell there is not."""
FELL = 2.5
JUMP_SIGMAS, LEAST_JUMP_M, LEAST_JUMP_M_S = 8.0, 2.0, 1.0
"""A jump is beyond what this receiver's own noise does in days, and beyond what matters."""
WORSE = 2.0
"""A receiver whose reported accuracy grew by this factor says itself that it errs."""
SMOOTHED = 5
_NORMAL = 0.6745


@dataclass(frozen=True)
class Jump:
    """A step of the reported position or velocity that no vehicle makes; `size` in m or m/s."""

    time: int
    size: float
    of_velocity: bool


@dataclass(frozen=True)
class GnssSigns:
    """Of the receiver in use, in the air.

    Attributes
    ----------
    samples : in the air
    ever_fixed : whether it had a fix at all, on the ground or in the air
    lost : times without a fix or without messages, µs
    worst : of `eph` m, `epv` m, `s_variance_m_s` m/s and `pdop`, medians of five samples, the worst in the air
    usual : the same, medians of the samples with a fix
    limit : what PX4 asks for before it takes the receiver, by the same names
    poor : when one of them was beyond its limit, µs
    satellites : fewest, medians of five samples
    usual_satellites : median
    jamming, usual_jamming : `jamming_indicator`, largest median of five and best; NaN where the receiver does not tell
    noise, usual_noise : `noise_per_ms`, likewise
    jammed : when either was up, or the receiver said that it is jammed (`jamming_state`), µs
    warned : whether it said so
    jumps : in the air, while the reported accuracy stayed
    position_noise : robust white noise of a horizontal position, m, against the receiver's own velocity
    """

    samples: int
    ever_fixed: bool
    lost: tuple[Interval, ...]
    worst: dict[str, float]
    usual: dict[str, float]
    limit: dict[str, float]
    poor: Interval | None
    satellites: float
    usual_satellites: float
    jamming: float
    usual_jamming: float
    noise: float
    usual_noise: float
    jammed: Interval | None
    warned: bool
    jumps: tuple[Jump, ...]
    position_noise: float


def gnss_signs(
    table: TopicTable | None, airborne: tuple[Interval, ...], motion: Motion | None = None
) -> GnssSigns | None:
    """Look at the messages; None without any in the air.

    Parameters
    ----------
    motion : of the replay; without it the velocity may not change faster than vehicles mostly do
    """
    if table is None or not airborne or "fix_type" not in table:
        return None
    time = table["timestamp"].astype(np.int64)
    fixed = has_fix(table)
    in_air = inside(time, airborne)
    if np.count_nonzero(in_air) < SMOOTHED:
        return None
    good = in_air & fixed
    names = {"eph": "EKF2_REQ_EPH", "epv": "EKF2_REQ_EPV", "s_variance_m_s": "EKF2_REQ_SACC"}
    told = {name: table[name].astype(np.float64) for name in names if name in table}
    # whoever raised what PX4 asks for flies with a poor receiver all the same
    limit = {name: PARAMETERS[parameter].default for name, parameter in names.items() if name in told}
    if "hdop" in table and "vdop" in table:
        told["pdop"] = np.hypot(table["hdop"].astype(np.float64), table["vdop"].astype(np.float64))
        limit["pdop"] = PARAMETERS["EKF2_REQ_PDOP"].default
    usual = {name: _median(values[good]) for name, values in told.items()}
    smooth = {name: _smoothed(values[good]) for name, values in told.items()}
    beyond = np.zeros(np.count_nonzero(good), bool)
    for name, values in smooth.items():
        if name in names:
            beyond |= is_poor(values, usual[name], limit[name])
    satellites = (
        _smoothed(table["satellites_used"][good].astype(np.float64)) if "satellites_used" in table else np.zeros(0)
    )
    jamming, noise = (_indicator(table, name, in_air) for name in ("jamming_indicator", "noise_per_ms"))
    up = np.zeros(np.count_nonzero(in_air), bool)
    for values, least in ((jamming, JAMMED_FROM), (noise, NOISY_FROM)):
        if values.size:
            best = float(np.min(values))
            up |= (values > least) & (values > 1.3 * best + 10.0)
    warned = np.zeros(up.size, bool)
    if "jamming_state" in table:
        warned = (table["jamming_state"][in_air] >= JAMMING_WARNING) & (
            table["jamming_state"][in_air] <= JAMMING_CRITICAL
        )
    jumps, position_noise = _jumps(table, time, good, told, motion)
    return GnssSigns(
        samples=int(np.count_nonzero(in_air)),
        ever_fixed=bool(fixed.any()),
        lost=_lost(time, fixed, airborne),
        worst={name: float(values.max()) if values.size else np.nan for name, values in smooth.items()},
        usual=usual,
        limit=limit,
        poor=_span(time[good], beyond),
        satellites=float(satellites.min()) if satellites.size else np.nan,
        usual_satellites=_median(satellites),
        jamming=float(jamming.max()) if jamming.size else np.nan,
        usual_jamming=float(jamming.min()) if jamming.size else np.nan,
        noise=float(noise.max()) if noise.size else np.nan,
        usual_noise=float(noise.min()) if noise.size else np.nan,
        jammed=_span(time[in_air], up | warned),
        warned=bool(warned.any()),
        jumps=jumps,
        position_noise=position_noise,
    )


JAMMING_WARNING, JAMMING_CRITICAL = 2, 3
JAMMED_FROM, NOISY_FROM = 60.0, 130.0
"""u-blox receivers give 0–255 for continuous-wave jamming, and some 80–100 of noise in the open."""


def has_fix(table: TopicTable) -> npt.NDArray[np.bool_]:
    """(N,) whether a message has a 3D fix, and a position that is one."""
    places = [table[name] for name in ("latitude_deg", "longitude_deg") if name in table]
    return np.asarray((table["fix_type"] >= FIX_3D) & np.logical_and.reduce([np.isfinite(one) for one in places]))


def is_poor(worst: Array | float, usual: float, limit: float) -> Any:
    """Whether an accuracy is beyond what PX4 asks for: clearly, or after it was far better."""
    return (worst > CLEARLY * limit) | ((worst > limit) & (worst > FELL * usual))


def _median(values: Array) -> float:
    return float(np.median(values)) if values.size else float("nan")


def _smoothed(values: Array) -> Array:
    """Running medians of five."""
    if values.size < SMOOTHED:
        return values
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(np.pad(values, 2, mode="edge"), 5), axis=1))


def _span(time: Times, where: npt.NDArray[np.bool_]) -> Interval | None:
    found = np.flatnonzero(where)
    return (int(time[found[0]]), int(time[found[-1]]) + 1) if found.size else None


def _indicator(table: TopicTable, name: str, rows: npt.NDArray[np.bool_]) -> Array:
    values = table[name][rows].astype(np.float64) if name in table else np.zeros(0)
    return _smoothed(values) if values.size and values.max() > 0.0 else np.zeros(0)


def _lost(time: Times, fixed: npt.NDArray[np.bool_], airborne: tuple[Interval, ...]) -> tuple[Interval, ...]:
    """Between two samples with a fix, longer than a second and than some intervals."""
    found = []
    step = float(np.median(np.diff(time))) if time.size > 1 else 1e6
    for start, stop in airborne:
        at = time[fixed & (time >= start) & (time < stop)]
        edges = np.r_[start, at, stop]
        for i in np.flatnonzero(np.diff(edges) > max(LOST_S * 1e6, SILENT_STEPS * step)):
            found.append((int(edges[i]), int(edges[i + 1])))
    return tuple(found)


def _jumps(
    table: TopicTable,
    time: Times,
    good: npt.NDArray[np.bool_],
    told: Mapping[str, Array],
    motion: Motion | None,
) -> tuple[tuple[Jump, ...], float]:
    rows = np.flatnonzero(good)
    if rows.size < 20 or "latitude_deg" not in table:
        return (), float("nan")
    at = time[rows]
    velocity = np.column_stack([table[f"vel_{axis}_m_s"][rows].astype(np.float64) for axis in "ned"])
    latitude, longitude = np.radians(table["latitude_deg"][rows]), np.radians(table["longitude_deg"][rows])
    north = (latitude - latitude[0]) * RADIUS_OF_EARTH
    east = (longitude - longitude[0]) * RADIUS_OF_EARTH * np.cos(latitude[0])
    step_s = np.diff(at) * 1e-6
    usual = step_s < 2.5 * np.median(step_s)
    way = 0.5 * (velocity[1:] + velocity[:-1])[:, :2] * step_s[:, None]
    moved = np.column_stack([np.diff(north), np.diff(east)]) - way
    change = np.diff(velocity, axis=0)
    found = []
    for values, least, of_velocity in ((moved, LEAST_JUMP_M, False), (change, LEAST_JUMP_M_S, True)):
        size = np.linalg.norm(values - np.median(values, axis=0), axis=1)
        name = "s_variance_m_s" if of_velocity else "eph"
        reported = told.get(name, np.zeros(time.size))[rows]
        steady = np.maximum(reported[1:], reported[:-1]) < WORSE * max(_median(reported), 1e-6)
        # of a velocity the vehicle's own acceleration is a part
        limit = max(least, JUMP_SIGMAS * float(np.median(size)) / 1.1774)
        unfelt = size
        if of_velocity:
            # whatever the heading, what the IMU felt is no jump
            unfelt = size - _gained(at, motion) if motion is not None else size
            limit = max(limit, 2.0 * float(np.percentile(size, 98)), MOST_ACCELERATION * float(np.median(step_s)))
        found += [
            Jump(int(at[i + 1]), float(size[i]), of_velocity)
            for i in np.flatnonzero((size > limit) & (unfelt > least) & usual & steady)
        ]
    noise = float(np.median(np.abs(moved - np.median(moved, axis=0)))) / _NORMAL / np.sqrt(2.0)
    return tuple(sorted(found, key=lambda one: one.time)), noise


def _gained(at: Times, motion: Motion) -> Array:
    """(N - 1,) most that the IMU's velocity changed by around the steps between (N,) messages, m/s.

    Receivers are late by up to `LATE_US`, and what they filter comes over more than a step.
    """
    ends = [motion.at(at - late, motion.free_velocity) for late in range(0, LATE_US + 1, LATE_US // 4)]
    first, last = np.array([one[:-1] for one in ends]), np.array([one[1:] for one in ends])
    return np.asarray(np.linalg.norm(last[None] - first[:, None], axis=3).max(axis=(0, 1)))


LATE_US = 400_000
MOST_ACCELERATION = 12.0
"""m/s²; a vehicle that gains more in a step between two messages is not believed."""
