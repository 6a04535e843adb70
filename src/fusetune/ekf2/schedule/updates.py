"""At which runs the filter updates, and over which interval: from levelling on, whenever the horizon moves.

Levelling waits until the filtered specific force is close to 1 g and the vehicle hardly turns. It looks at every run,
also at those that complete no interval, so the first update may come between two intervals; PX4 does the same.

Mirrors `Ekf::initialiseFilter` of PX4 v1.16 `EKF/ekf.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.filter.common.levelling import LPF_ALPHA
from fusetune.ekf2.numerics.constants import ONE_G
from fusetune.ekf2.releases.behaviours import BEHAVIOURS
from fusetune.ekf2.releases.by_release import by_release, does, marked
from fusetune.ekf2.schedule.imu_intervals import oldest_buffered
from fusetune.ekf2.schedule.timeline import value_at

MIN_SPECIFIC_FORCE = 0.8 * ONE_G
MAX_SPECIFIC_FORCE = 1.2 * ONE_G
MAX_RATE = math.radians(15.0)
MIN_IMU_INTERVAL_S = 1e-4

INITIAL_INTERVAL_S = 0.01
NEVER = np.iinfo(np.int64).max

UPDATE = np.dtype([*fields("i4", "run", "delayed"), ("average_dt", "f8")], align=True)
"""The run of an update, the index of its interval, and the mean interval (s) when it is over."""

LEVELLING = np.dtype([*fields("f8", "accel", "gyro", shape=(3,)), ("begun", "?"), ("started_run", "i8")], align=True)
"""Filtered specific force (m/s²) and rate (rad/s), body; the run from which a given state is the filter's, or -1."""

STARTING_SAMPLES = np.dtype(
    [
        *fields("i8", "earliest_run", "levelled_run", "mag_count", "baro_count", "baro_time_us"),
        ("mag", "f8", (3,)),
        *fields("f8", "baro_offset", "baro_height"),
    ],
    align=True,
)
"""What else a release has in its LEVELLING that starts with samples: the first run at which there are enough, and the
run at which it did start, or -1; how many there were of magnetometer and barometer, and their low-passed values (Gauss,
body; m); time (µs) and height (m) of the barometer's last."""


def levelling_record(release: str) -> np.dtype:
    """LEVELLING of a release."""
    own = STARTING_SAMPLES if BEHAVIOURS[release].starts_with_samples else np.dtype([])
    places = [(name, dtype[name]) for dtype in (LEVELLING, own) for name in dtype.names or ()]
    return marked(np.dtype(places, align=True), release)


@kernel
def _at_once(levelling, run):
    return True


@kernel
def _with_samples(levelling, run):
    if run < levelling.earliest_run:
        return False
    levelling.levelled_run = run
    return True


_may_start = by_release(_at_once, "starts_with_samples", _with_samples)
"""Whether a filter that is level may start at a run."""


_starts_at_any_run = does("starts_with_samples")
"""Whether the filter may start at a run that ends no interval; the first update is then that of the next interval."""


@kernel
def _schedule_updates(intervals, imu, predict_us, imu_length, start_us, levelling, updates):
    """Fill `updates`; return how many there are.

    Parameters
    ----------
    intervals, predict_us : as `down_sample` has them
    imu : IMU_ROW of every run
    imu_length : of the IMU buffer
    start_us : the filter is given a state once the horizon has come to this time; NEVER for not at all
    levelling : LEVELLING record of zeros; holds the specific force by which the filter is levelled
    updates : UPDATE, as many as there are intervals
    """
    levelling.started_run = -1
    runs, count, newest = len(imu), 0, -1
    levelled, is_waiting = False, False
    average = INITIAL_INTERVAL_S
    run = 0
    while run < runs:
        if newest + 1 < len(intervals) and intervals[newest + 1].run == run:
            newest += 1
            is_waiting = True
        delayed = oldest_buffered(newest, imu_length)
        if not levelled and newest >= 0:
            levelled = _is_level(intervals[newest], levelling) and _may_start(levelling, run)
            if levelled and _starts_at_any_run(levelling):
                is_waiting = intervals[newest].run == run
        if levelled and is_waiting:
            is_waiting = False
            average = averaged_interval(intervals[delayed], average, value_at(predict_us, run))
            updates[count].run = run
            updates[count].delayed = delayed
            updates[count].average_dt = average
            count += 1
        if levelling.started_run < 0:
            horizon_us = intervals[delayed].time_us if newest >= 0 else imu[0].time_us
            if horizon_us >= start_us:
                levelling.started_run = run + 1
                levelled = True
        run += 1
        # the horizon stays between two intervals, so that there is nothing to do for a filter that runs
        if levelled and not is_waiting:
            run = intervals[newest + 1].run if newest + 1 < len(intervals) else runs
    return count


@kernel
def _schedule_updates_by_horizon(intervals, imu, predict_us, imu_length, start_us, levelling, updates):
    """As v1.16's, but what is low-passed for levelling, and averaged, is at the horizon, once per interval."""
    levelling.started_run = -1
    count, levelled, average = 0, False, INITIAL_INTERVAL_S
    if len(imu) > 0 and imu[0].time_us >= start_us:
        levelling.started_run = 1
        levelled = True
    for newest in range(len(intervals)):
        run = intervals[newest].run
        delayed = oldest_buffered(newest, imu_length)
        if newest == 0:
            average = float(_limited_interval(intervals[delayed], value_at(predict_us, run)))
        else:
            average = averaged_interval(intervals[delayed], average, value_at(predict_us, run))
        if not levelled:
            levelled = _is_level(intervals[delayed], levelling)
        if levelled:
            updates[count].run = run
            updates[count].delayed = delayed
            updates[count].average_dt = average
            count += 1
        if levelling.started_run < 0 and intervals[delayed].time_us >= start_us:
            levelling.started_run = run + 1
            levelled = True
    return count


schedule_updates = by_release(_schedule_updates, "levels_at_the_horizon", _schedule_updates_by_horizon)


@kernel
def averaged_interval(interval, average, predict_us):
    """Average the estimator interval (s), in single precision since PX4 derives time stamps (µs) from it."""
    limited = _limited_interval(interval, predict_us)
    return float(np.float32(0.99) * np.float32(average) + np.float32(0.01) * limited)


@kernel
def _limited_interval(interval, predict_us):
    mean = np.float32(0.5) * (np.float32(interval.delta_vel_dt) + np.float32(interval.delta_ang_dt))
    nominal = np.float32(1e-6) * np.float32(predict_us)
    return min(max(mean, np.float32(0.5) * nominal), np.float32(2.0) * nominal)


@kernel
def _is_level(interval, levelling):
    """Filter what the newest interval measured once more, and judge it."""
    if interval.delta_vel_dt < MIN_IMU_INTERVAL_S or interval.delta_ang_dt < MIN_IMU_INTERVAL_S:
        return False
    accel, gyro = levelling.accel, levelling.gyro
    alpha = LPF_ALPHA if levelling.begun else 1.0
    levelling.begun = True
    for i in range(3):
        accel[i] += alpha * (interval.delta_vel[i] / interval.delta_vel_dt - accel[i])
        gyro[i] += alpha * (interval.delta_ang[i] / interval.delta_ang_dt - gyro[i])
    specific_force = math.sqrt(accel[0] ** 2 + accel[1] ** 2 + accel[2] ** 2)
    rate = math.sqrt(gyro[0] ** 2 + gyro[1] ** 2 + gyro[2] ** 2)
    return not (specific_force < MIN_SPECIFIC_FORCE or specific_force > MAX_SPECIFIC_FORCE or rate > MAX_RATE)
