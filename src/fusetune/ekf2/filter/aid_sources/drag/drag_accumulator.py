"""Mean of the specific force along body X and Y over a few IMU samples, as drag observation.

Mirrors `setDragData` of PX4 v1.16's `estimator_interface.cpp`, which runs for every raw IMU sample while
EKF2_DRAG_CTRL asks for it.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.releases.by_release import by_release

MIN_SAMPLES_PER_MEAN = 5


@kernel
def _restart(drag):
    drag.sample_count = 0
    drag.delta_vel_sum[0] = 0.0
    drag.delta_vel_sum[1] = 0.0
    drag.time_sum_us = 0
    drag.dt_sum = 0.0


@kernel
def _take_every_sample(drag, ends_interval):
    return True


@kernel
def _take_last_samples(drag, ends_interval):
    """Only the last raw sample of each that the filter runs by."""
    return ends_interval


may_average = by_release(_take_every_sample, "averages_last_drag", _take_last_samples)
"""Whether a raw sample, which ends an interval of the filter or does not, counts for drag."""


@kernel
def _is_clipped(drag, imu):
    return imu.delta_vel_clipping[0] or imu.delta_vel_clipping[1] or imu.delta_vel_clipping[2]


@kernel
def _never(drag, imu):
    return False


_is_spoilt = by_release(_is_clipped, "averages_clipped_drag", _never)


@kernel
def accumulate_drag(drag, imu, imu_buffer_length, obs_buffer_length):
    """Take in one raw IMU sample; return whether `drag.produced` holds a new mean to be buffered.

    A clipped sample discards what had been summed up, since v1.15. The mean carries the mean time of its samples (µs).
    """
    if _is_spoilt(drag, imu):
        _restart(drag)
        return False
    drag.sample_count += 1
    drag.delta_vel_sum[0] += imu.delta_vel[0]
    drag.delta_vel_sum[1] += imu.delta_vel[1]
    drag.time_sum_us += imu.time_us
    drag.dt_sum += imu.delta_vel_dt
    buffer_ratio = (imu_buffer_length + obs_buffer_length - 1) // obs_buffer_length
    if drag.sample_count < max(buffer_ratio, MIN_SAMPLES_PER_MEAN):
        return False
    drag.produced.accel_xy[0] = drag.delta_vel_sum[0] / drag.dt_sum
    drag.produced.accel_xy[1] = drag.delta_vel_sum[1] / drag.dt_sum
    drag.produced.time_us = drag.time_sum_us // drag.sample_count
    _restart(drag)
    return True
