"""The IMU samples of a flight, down-sampled to the intervals over which the filter predicts."""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.filter.imu_down_sampler.imu_down_sampler import (
    accumulate_imu,
    initialise_down_sampler,
    reset_down_sampler,
)
from fusetune.ekf2.schedule.timeline import value_at

MIN_DT_FACTOR, MAX_DT_FACTOR = np.float32(0.5), np.float32(2.0)

IMU_INTERVAL = np.dtype(
    [
        ("time_us", "i8"),
        *fields("f8", "delta_ang", "delta_vel", shape=(3,)),
        *fields("f4", "delta_ang_dt", "delta_vel_dt"),
        ("run", "i4"),
        ("delta_vel_clipping", "u1", (3,)),
    ],
    align=True,
)
"""An IMU_SAMPLE over one interval, in less room, and the run that completes it."""


@kernel
def down_sample(imu, predict_us, sampler, intervals):
    """Fill `intervals` from the IMU samples of all runs; return how many there are.

    Parameters
    ----------
    imu : IMU_ROW of every run
    predict_us : TIMELINE of EKF2_PREDICT_US
    sampler : DOWN_SAMPLER_MEMORY record of zeros, to work with
    intervals : IMU_INTERVAL, as many as there are runs
    """
    initialise_down_sampler(sampler)
    count = 0
    for run in range(len(imu)):
        if accumulate_imu(sampler, imu[run]):
            length_us = value_at(predict_us, run)
            _keep(sampler.sample, length_us, intervals[count])
            intervals[count].run = run
            reset_down_sampler(sampler, length_us)
            count += 1
    return count


@kernel
def _keep(sample, length_us, interval):
    """PX4 keeps the durations within half and twice EKF2_PREDICT_US."""
    period = np.float32(length_us) * np.float32(1e-6)
    low, high = MIN_DT_FACTOR * period, MAX_DT_FACTOR * period
    interval.time_us = sample.time_us
    interval.delta_ang_dt = min(max(np.float32(sample.delta_ang_dt), low), high)
    interval.delta_vel_dt = min(max(np.float32(sample.delta_vel_dt), low), high)
    for axis in range(3):
        interval.delta_ang[axis] = sample.delta_ang[axis]
        interval.delta_vel[axis] = sample.delta_vel[axis]
        interval.delta_vel_clipping[axis] = sample.delta_vel_clipping[axis] != 0


@kernel
def oldest_buffered(newest, imu_length):
    """Index of the interval at the fusion time horizon once that of index `newest` is buffered."""
    return max(newest - imu_length + 1, 0)
