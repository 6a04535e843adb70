"""What the IMU itself shows: shaking, clipping, lost samples, its biases at rest."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.analyze.flight.intervals import Interval, duration, inside
from fusetune.analyze.metrics.grouping import distinct, rows_of
from fusetune.analyze.replaying.replayed_set import ReplayedSteps
from fusetune.px4.flight import Flight, TopicTable, select_rows, stacked

Array = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

IMU, STATUS = "sensor_combined", "vehicle_imu_status"
LONG_GAP_S = 0.05
"""Loggers lose single samples; the estimator misses nothing of these."""
REST_RATE_RAD_S, REST_FORCE_M_S2, REST_S = 0.01, 0.25, 1.0
"""At rest second means of gyros and accelerometers differ by less. A steady turn is none for the gyros alone: a bank
of 1.5° moves gravity by so much."""
BIAS_OVER_S = 5.0


@dataclass(frozen=True)
class ImuSigns:
    """Of the IMU in use, in the air.

    Attributes
    ----------
    rate_hz : of the samples in the log
    shaking, gyro_shaking : RMS of the change from one sample to the next over √2, all axes together, m/s² and rad/s;
        the white part of the noise at the sample rate
    vibration_metric : worst of `vehicle_imu_status.accel_vibration_metric`, smoothed over ten seconds; NaN without it
    clipped : samples with a clipped axis
    clipped_share : of the samples
    clipping : from the first to the last of them, µs
    gaps : stretches without samples longer than `LONG_GAP_S`, µs
    lost_s : how long these are together
    lost_share : of the time in the air in which samples are missing, short gaps too
    resting_force : size of the specific force before the motors turn, m/s²; NaN where the vehicle did not rest
    """

    rate_hz: float
    shaking: float
    gyro_shaking: float
    vibration_metric: float
    clipped: int
    clipped_share: float
    clipping: Interval | None
    gaps: tuple[Interval, ...]
    lost_s: float
    lost_share: float
    resting_force: float


def imu_signs(flight: Flight, airborne: tuple[Interval, ...]) -> ImuSigns | None:
    """Look at the IMU in the air; None where there are no samples of it."""
    table = _in_order(flight.topic(IMU))
    if table is None or not airborne:
        return None
    time = table["timestamp"].astype(np.int64)
    rows = inside(time, airborne)
    if np.count_nonzero(rows) < 50:
        return None
    time, force, rate = time[rows], stacked(table, "accelerometer_m_s2")[rows], stacked(table, "gyro_rad")[rows]
    step = np.diff(time)
    near = step < 2.0 * np.median(step)
    shaking = float(np.sqrt(np.mean(np.sum(np.diff(force, axis=0)[near] ** 2, axis=1)) / 2.0))
    gyro = float(np.sqrt(np.mean(np.sum(np.diff(rate, axis=0)[near] ** 2, axis=1)) / 2.0))
    clipped = _clipped(table, flight, airborne)
    gaps = tuple(
        (int(time[i]), int(time[i + 1]))
        for i in np.flatnonzero(step > LONG_GAP_S * 1e6)
        if _in_one(time[i], time[i + 1], airborne)
    )
    return ImuSigns(
        rate_hz=1e6 / max(float(np.median(step)), 1.0),
        shaking=shaking,
        gyro_shaking=gyro,
        vibration_metric=_vibration_metric(flight, airborne),
        clipped=clipped.size,
        clipped_share=clipped.size / max(time.size, 1),
        clipping=(int(clipped[0]), int(clipped[-1]) + 1) if clipped.size else None,
        gaps=gaps,
        lost_s=duration(gaps) * 1e-6,
        lost_share=_lost_share(time, table, rows, airborne),
        resting_force=_resting_force(table, airborne[0][0]),
    )


def _in_order(table: TopicTable | None) -> TopicTable | None:
    """Samples in order of time: a clock that steps back is told of by the verdict, and ends no sign."""
    if table is None or not bool((np.diff(table["timestamp"].astype(np.int64)) < 0).any()):
        return table
    return select_rows(table, np.argsort(table["timestamp"], kind="stable"))


def _resting_force(table: TopicTable, takeoff: int) -> float:
    """Of the seconds that shake and turn little."""
    time = table["timestamp"].astype(np.int64)
    rows = time < takeoff - REST_MARGIN_US
    force = np.linalg.norm(stacked(table, "accelerometer_m_s2")[rows], axis=1)
    if force.size < 100:
        return float("nan")
    # a clock that jumps leaves seconds out
    second = np.unique(((time[rows] - time[0]) * 1e-6).astype(np.int64), return_inverse=True)[1]
    counts = np.bincount(second)
    mean = np.bincount(second, force) / counts
    spread = np.sqrt(np.maximum(np.bincount(second, force**2) / counts - mean**2, 0.0))
    still = (spread < RESTING_SHAKE) & (counts > 0.5 * np.median(counts))
    return float(np.median(mean[still])) if np.count_nonzero(still) >= 2 else float("nan")


RESTING_SHAKE = 0.4
"""m/s², standard deviation within a second; propellers that turn on the ground make more."""


def _lost_share(time: Times, table: TopicTable, rows: npt.NDArray[np.bool_], airborne: tuple[Interval, ...]) -> float:
    """Of the steps from sample to sample what is longer than the samples say that they were integrated."""
    step = np.diff(time).astype(np.float64)
    usual = float(np.median(step))
    told = (
        table["gyro_integral_dt"][rows][1:].astype(np.float64)
        if "gyro_integral_dt" in table
        else np.full(step.size, usual)
    )
    told = np.where((told > 0.3 * usual) & (told < 50.0 * usual), told, usual)
    same = (
        np.array([_in_one(a, b, airborne) for a, b in itertools.pairwise(time)])
        if len(airborne) > 1
        else np.ones(step.size, bool)
    )
    missing = np.where((step > 1.5 * usual) & same, np.maximum(step - told, 0.0), 0.0)
    return float(missing.sum() / max(step[same].sum(), 1.0))


def _in_one(start: np.integer, stop: np.integer, intervals: tuple[Interval, ...]) -> bool:
    return any(first <= start and stop <= last for first, last in intervals)


def _clipped(table: TopicTable, flight: Flight, airborne: tuple[Interval, ...]) -> Times:
    """Times at which an axis clipped, of the samples, or of the counters where samples do not tell."""
    if "accelerometer_clipping" in table:
        time = table["timestamp"].astype(np.int64)
        return time[inside(time, airborne) & (table["accelerometer_clipping"] != 0)]
    counts = flight.topic(STATUS)
    if counts is None or "accel_clipping[0]" not in counts:
        return np.zeros(0, np.int64)
    time, total = counts["timestamp"].astype(np.int64), stacked(counts, "accel_clipping").sum(axis=1)
    more = np.diff(total, prepend=total[:1]) > 0
    return np.asarray(time[more & inside(time, airborne)])


def _vibration_metric(flight: Flight, airborne: tuple[Interval, ...]) -> float:
    worst = np.nan
    for instance in flight.instances(STATUS):
        table = flight.topics[STATUS, instance]
        if "accel_vibration_metric" not in table:
            continue
        rows = inside(table["timestamp"].astype(np.int64), airborne)
        values = table["accel_vibration_metric"][rows].astype(np.float64)
        if values.size >= 5:
            worst = float(np.nanmax([worst, np.median(values)]))
    return worst


@dataclass(frozen=True)
class GyroBias:
    """Bias of the gyros over a flight, rad/s.

    Attributes
    ----------
    at_rest : (3,) mean reading before take-off; NaN where the vehicle did not rest
    course_s, course : (K,) s and (K, 3), readings at rest on the ground and the replay's estimates in the air
    change : (3,) largest less smallest of the course
    """

    at_rest: Array
    course_s: Array
    course: Array
    change: Array


def gyro_bias(flight: Flight, steps: ReplayedSteps | None, airborne: tuple[Interval, ...]) -> GyroBias | None:
    """Bias at rest and in flight; None without gyros."""
    table = _in_order(flight.topic(IMU))
    if table is None or not airborne:
        return None
    time = table["timestamp"].astype(np.int64)
    before = time < airborne[0][0] - REST_MARGIN_US
    after = time > airborne[-1][1] + REST_MARGIN_US
    rate, force = stacked(table, "gyro_rad"), stacked(table, "accelerometer_m_s2")
    parts = [_at_rest(time[rows], rate[rows], force[rows]) for rows in (before, after)]
    at_rest = np.median(parts[0][1], axis=0) if len(parts[0][0]) else np.full(3, np.nan)
    parts.insert(1, _estimated(steps, airborne))
    seconds, course = (np.concatenate([part[i] for part in parts]) for i in range(2))
    change = np.ptp(course, axis=0) if len(course) > 1 else np.zeros(3)
    return GyroBias(at_rest, seconds, course, change)


def _at_rest(time: Times, rate: Array, force: Array) -> tuple[Array, Array]:
    """Second means of the rates, where neighbours are alike and gravity stays where it is: (K,) s, (K, 3)."""
    nothing = np.zeros(0), np.zeros((0, 3))
    if time.size < 50:
        return nothing
    seconds, second = np.unique(((time - time[0]) * 1e-6 / REST_S).astype(np.int64), return_inverse=True)
    counts = np.bincount(second)
    means, pulls = (
        np.column_stack([np.bincount(second, axis) / counts for axis in values.T]) for values in (rate, force)
    )
    at = time[0] * 1e-6 + REST_S * (seconds + 0.5)
    full = counts > 0.8 * np.median(counts)
    means, pulls, at = means[full], pulls[full], at[full]
    if len(means) < 2:
        return nothing
    near = np.abs(np.diff(means, axis=0)).max(axis=1) < REST_RATE_RAD_S
    near &= np.linalg.norm(np.diff(pulls, axis=0), axis=1) < REST_FORCE_M_S2
    still = np.r_[near, False] | np.r_[False, near]
    # a vehicle that is carried turns by its neighbours' differences, one at rest does not
    return (at[still], means[still]) if np.mean(still) > 0.5 else nothing


def _estimated(steps: ReplayedSteps | None, airborne: tuple[Interval, ...]) -> tuple[Array, Array]:
    """Medians of five seconds of the estimate, but for the first ten in the air, in which it settles."""
    if steps is None:
        return np.zeros(0), np.zeros((0, 3))
    rows = inside(steps.time, airborne) & (steps.time > airborne[0][0] + SETTLED_US)
    if not rows.any():
        return np.zeros(0), np.zeros((0, 3))
    time, bias = steps.time[rows] * 1e-6, steps.gyro_bias[rows]
    block = ((time - time[0]) / BIAS_OVER_S).astype(np.int64)
    parts = list(rows_of(block, distinct(block)))
    return np.array([time[own].mean() for own in parts]), np.array([np.median(bias[own], axis=0) for own in parts])


REST_MARGIN_US, SETTLED_US = 1_500_000, 10_000_000
