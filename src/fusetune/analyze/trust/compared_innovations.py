"""Innovations of a replay beside those that the vehicle logged, compared by their size."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fusetune.analyze.flight.intervals import Interval, inside
from fusetune.analyze.replaying.samples import AxisSamples, SourceAxis
from fusetune.ekf2.filter.common import state as S
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES
from fusetune.ekf2.replay.results import ReplayResult
from fusetune.px4.aid_sources import AID_SOURCES

GROUPS: Mapping[str, tuple[SourceAxis, ...]] = {
    source.size_figure: tuple((source.name, axis) for axis in source.groups[0][1])
    for source in AID_SOURCES.values()
    if source.size_figure
}
"""Innovations that are compared by their size."""

NEAR_US = 1_000_000
"""Innovations of the replay count within this time of one that the vehicle fused: it may use a source for a while."""

MIN_SAMPLES = 8
"""Fewer than this are not compared."""


def innovation_ratios(
    result: ReplayResult,
    measured: np.ndarray,
    intervals: tuple[Interval, ...],
    onboard: Mapping[SourceAxis, AxisSamples],
) -> dict[str, float]:
    """RMS of the replay's innovations over that of the vehicle's, of each of the `GROUPS` that both have."""
    ratios = {}
    for group, keys in GROUPS.items():
        ours, theirs = [], []
        for key in keys:
            if key in onboard:
                time, innovation = replayed_innovations(result, measured, *key)
                logged = onboard[key]
                flown = inside(logged.timestamp_sample, intervals) & logged.fused
                used = inside(time, intervals) & _near(time, logged.timestamp_sample[flown])
                ours.append(innovation[used])
                theirs.append(logged.innovation[flown])
        if ours and min(sum(map(len, ours)), sum(map(len, theirs))) >= MIN_SAMPLES * len(ours):
            ratios[group] = rms(ours) / max(rms(theirs), 1e-9)
    return ratios


def rms(parts: list[np.ndarray]) -> float:
    """Root mean square over several arrays."""
    values = np.concatenate(parts)
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def replayed_innovations(
    result: ReplayResult, measured: np.ndarray, source: str, axis: int
) -> tuple[np.ndarray, np.ndarray]:
    """Times and innovations of measured samples from the first that was fused on, for before it they mean nothing.

    `mag_heading` is made from the magnetometer's where the replay fuses no heading (since v1.15).
    """
    if source == "mag_heading" and not _fuses_heading(result):
        return _heading_innovations(result, measured)
    rows = result.innovations[
        (result.innovations["source"] == AID_SOURCE_NAMES.index(source))
        & (result.innovations["axis"] == axis)
        & measured
    ]
    rows = rows[rows["innovation_variance"] > 0]
    rows = rows[int(np.argmax(rows["fused"])) :] if rows["fused"].any() else rows[:0]
    return rows["timestamp_sample"], rows["innovation"].astype(np.float64)


def _fuses_heading(result: ReplayResult) -> bool:
    rows = result.innovations
    return bool(np.any(rows["fused"][rows["source"] == AID_SOURCE_NAMES.index("mag_heading")]))


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
    return time[known], wrapped(angle[known])


def _near(time: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Whether any of `others`, ascending, lies within `NEAR_US` of each time."""
    if not len(others):
        return np.zeros(len(time), np.bool_)
    after = np.minimum(np.searchsorted(others, time), len(others) - 1)
    before = np.maximum(after - 1, 0)
    return np.minimum(np.abs(others[after] - time), np.abs(others[before] - time)) <= NEAR_US


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Angles, rad, brought to −π … π."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
