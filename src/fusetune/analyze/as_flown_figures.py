"""How far a replay of the parameters that flew is from the vehicle's own estimator: figures that do not need the same
measurements.

A default log holds two innovations a second, of GNSS samples that it mostly does not hold itself, so sample by sample
there is little to compare. What can be compared is how large the innovations are, and the state at any time: velocity,
heading, flags.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fusetune.analyze.onboard import onboard_samples
from fusetune.analyze.set_files import AxisSamples, SourceAxis
from fusetune.analyze.sources import HORIZONTAL_AIDING
from fusetune.ekf2 import state as S
from fusetune.ekf2.aid_source_status import AID_SOURCE_NAMES
from fusetune.ekf2.recording import FLAG_COLUMNS, RecordArrays, with_fields
from fusetune.ekf2.replay import ReplayResult
from fusetune.px4.estimator_instances import rows_of_primary
from fusetune.px4.flight import Flight, TopicTable, row_count

GROUPS: Mapping[str, tuple[SourceAxis, ...]] = {
    "horizontal_velocity": (("gnss_vel", 0), ("gnss_vel", 1)),
    "horizontal_position": (("gnss_pos", 0), ("gnss_pos", 1)),
    "heading": (("mag_heading", 0),),
    "magnetic_field": (("mag", 0), ("mag", 1), ("mag", 2)),
}
"""Innovations that are compared by their size."""

COMPARED_FLAGS = (
    "cs_tilt_align", "cs_yaw_align", "cs_gnss_pos", "cs_baro_hgt", "cs_ev_pos", "cs_opt_flow", "cs_in_air",
    "fs_bad_acc_vertical",
)  # fmt: skip
"""Flags that mean the same in all releases."""

MIN_SAMPLES = 8
Interval = tuple[int, int]


@dataclass(frozen=True)
class AsFlownFigures:
    """A replay against the vehicle.

    Attributes
    ----------
    innovation_ratio : group → RMS of the replay's innovations over that of the vehicle's
    velocity_m_s, heading_deg : RMS difference of horizontal velocity and heading; None where the log has none
    flags_equal : mean share of the time in which each flag agrees; None where the log has none
    compared_s : length of the flight that was compared
    """

    innovation_ratio: dict[str, float]
    velocity_m_s: float | None
    heading_deg: float | None
    flags_equal: float | None
    compared_s: float

    @property
    def innovation_factor(self) -> float | None:
        """By how much the innovations of the worst group are larger or smaller than the vehicle's."""
        factors = [max(ratio, 1.0 / max(ratio, 1e-9)) for ratio in self.innovation_ratio.values()]
        return max(factors, default=None)


def as_flown_figures(
    result: ReplayResult,
    measured: np.ndarray,
    flight: Flight,
    intervals: tuple[Interval, ...],
    onboard: Mapping[SourceAxis, AxisSamples] | None = None,
) -> AsFlownFigures:
    """Compare a replay with the log of the vehicle's own estimator.

    Parameters
    ----------
    result, measured : of the replay, from `fusetune.analyze.replay_flight.PreparedFlight.replay`
    flight : in the layout of `fusetune.px4.release_layouts.canonical`
    intervals : parts of the flight that are compared, µs
    onboard : the vehicle's innovations; by default those of its primary instance
    """
    onboard = onboard_samples(flight) if onboard is None else onboard
    ratios = {}
    for group, keys in GROUPS.items():
        ours, theirs = [], []
        for key in keys:
            if key in onboard:
                time, innovation = replayed_innovations(result, measured, *key)
                logged = onboard[key]
                ours.append(innovation[_inside(time, intervals)])
                theirs.append(logged.innovation[_inside(logged.timestamp_sample, intervals) & logged.fused])
        if ours and min(sum(map(len, ours)), sum(map(len, theirs))) >= MIN_SAMPLES * len(ours):
            ratios[group] = rms(ours) / max(rms(theirs), 1e-9)
    velocity, heading = _state_differences(result, flight, intervals)
    return AsFlownFigures(
        ratios,
        velocity,
        heading,
        _flags_equal(result, flight, intervals),
        sum(stop - start for start, stop in intervals) * 1e-6,
    )


def compared_rows(onboard: Mapping[SourceAxis, AxisSamples]) -> Callable[[RecordArrays], RecordArrays]:
    """What `as_flown_figures` needs of a replay's rows, for `fusetune.ekf2.replay.replay` to keep.

    Parameters
    ----------
    onboard : the vehicle's innovations
    """
    keys = {key for keys in GROUPS.values() for key in keys if key in onboard}
    wanted = {source for source, _ in keys} | {*HORIZONTAL_AIDING} & {*AID_SOURCE_NAMES}
    by_heading = "mag_heading" in wanted
    wanted = wanted - {"mag_heading"} | ({"mag"} if by_heading else set())
    sources = [AID_SOURCE_NAMES.index(name) for name in sorted(wanted)]

    def keep(rows: RecordArrays) -> RecordArrays:
        return RecordArrays(
            innovations=rows.innovations[np.isin(rows.innovations["source"], sources)],
            states=with_fields(rows.states if by_heading else rows.states[:0], ("timestamp_sample", "states")),
            local_position=with_fields(rows.local_position, ("timestamp", "vx", "vy", "heading")),
            flags=rows.flags,
        )

    return keep


def rms(parts: list[np.ndarray]) -> float:
    """Root mean square over several arrays."""
    values = np.concatenate(parts)
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def replayed_innovations(
    result: ReplayResult, measured: np.ndarray, source: str, axis: int
) -> tuple[np.ndarray, np.ndarray]:
    """Times and innovations of measured samples from the first that was fused on, for before it they mean nothing.

    `mag_heading` is made from the magnetometer's.
    """
    if source == "mag_heading":
        return _heading_innovations(result, measured)
    rows = result.innovations[
        (result.innovations["source"] == AID_SOURCE_NAMES.index(source))
        & (result.innovations["axis"] == axis)
        & measured
    ]
    rows = rows[rows["innovation_variance"] > 0]
    rows = rows[int(np.argmax(rows["fused"])) :] if rows["fused"].any() else rows[:0]
    return rows["timestamp_sample"], rows["innovation"].astype(np.float64)


def _heading_innovations(result: ReplayResult, measured: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angle (rad) from the estimated magnetic north to where the measured field points, seen in the estimated frame.

    That is what releases before v1.14 fused as heading: predicted minus measured yaw.
    """
    rows = result.innovations
    chosen = (rows["source"] == AID_SOURCE_NAMES.index("mag")) & measured
    axes = [rows[chosen & (rows["axis"] == axis)] for axis in range(3)]
    if not len(axes[0]) or not len(result.states):
        return np.zeros(0, np.int64), np.zeros(0)
    time = axes[0]["timestamp_sample"]
    at = np.clip(np.searchsorted(result.states["timestamp_sample"], time), 0, len(result.states) - 1)
    states = result.states["states"][at].astype(np.float64)
    field = np.stack([axis["observation"] for axis in axes], axis=-1).astype(np.float64)
    field -= states[:, S.PUBLISHED_MAG_BODY : S.PUBLISHED_MAG_BODY + 3]
    w, x, y, z = (states[:, S.PUBLISHED_QUATERNION + i] for i in range(4))
    north = (
        (1 - 2 * (y * y + z * z)) * field[:, 0] + 2 * (x * y - w * z) * field[:, 1] + 2 * (x * z + w * y) * field[:, 2]
    )
    east = (
        2 * (x * y + w * z) * field[:, 0] + (1 - 2 * (x * x + z * z)) * field[:, 1] + 2 * (y * z - w * x) * field[:, 2]
    )
    earth = states[:, S.PUBLISHED_MAG_EARTH : S.PUBLISHED_MAG_EARTH + 2]
    known = np.linalg.norm(earth, axis=1) > 0.0
    angle = np.arctan2(east, north) - np.arctan2(earth[:, 1], earth[:, 0])
    return time[known], _wrapped(angle[known])


def _wrapped(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def _inside(time: np.ndarray, intervals: tuple[Interval, ...]) -> np.ndarray:
    inside = np.zeros(len(time), np.bool_)
    for start, stop in intervals:
        inside |= (time >= start) & (time < stop)
    return inside


def _state_differences(
    result: ReplayResult, flight: Flight, intervals: tuple[Interval, ...]
) -> tuple[float | None, float | None]:
    """RMS difference of horizontal velocity (m/s) and heading (deg) from what the vehicle published."""
    local = flight.topic("vehicle_local_position")
    ours = result.local_position
    if local is None or len(ours) < 2:
        return None, None
    time = local.get("timestamp_sample", local["timestamp"]).astype(np.int64)
    usable = _inside(time, intervals) & (time >= ours["timestamp"][0]) & (time <= ours["timestamp"][-1])
    for name in ("v_xy_valid", "xy_valid"):
        if name in local:
            usable &= local[name].astype(bool)
    if usable.sum() < MIN_SAMPLES:
        return None, None
    time = time[usable]
    squares = [
        (np.interp(time, ours["timestamp"], ours[name]) - local[name][usable].astype(np.float64)) ** 2
        for name in ("vx", "vy")
    ]
    velocity = float(np.sqrt(np.mean(np.sum(squares, axis=0))))
    return velocity, _heading_difference(ours, local, time, usable)


def _heading_difference(ours: np.ndarray, local: TopicTable, time: np.ndarray, usable: np.ndarray) -> float | None:
    name = next((name for name in ("heading", "yaw") if name in local), None)
    if name is None:
        return None
    at = np.clip(np.searchsorted(ours["timestamp"], time), 0, len(ours) - 1)
    difference = _wrapped(ours["heading"][at] - local[name][usable].astype(np.float64))
    return float(np.degrees(np.sqrt(np.mean(difference**2))))


def _flags_equal(result: ReplayResult, flight: Flight, intervals: tuple[Interval, ...]) -> float | None:
    table = rows_of_primary(flight, "estimator_status_flags")
    if table is None or not row_count(table) or not len(result.flags) or not intervals:
        return None
    step_us = 100_000
    times = np.concatenate([np.arange(start, stop, step_us) for start, stop in intervals])
    theirs = np.maximum(np.searchsorted(table["timestamp"].astype(np.int64), times, side="right") - 1, 0)
    ours = np.maximum(np.searchsorted(result.flags["timestamp"], times, side="right") - 1, 0)
    shares = [
        float(np.mean(table[name][theirs].astype(bool) == result.flags["flags"][ours, FLAG_COLUMNS.index(name)]))
        for name in COMPARED_FLAGS
        if name in table
    ]
    return float(np.mean(shares)) if shares and len(times) else None
