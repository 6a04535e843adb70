"""Time conditions at the fusion time horizon, and the intervals that PX4 v1.16 compares them with (µs)."""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.releases.by_release import by_release

BARO_MAX_INTERVAL = 200_000
EV_MAX_INTERVAL = 200_000
GNSS_MAX_INTERVAL = 500_000
GNSS_YAW_MAX_INTERVAL = 1_500_000
RNG_MAX_INTERVAL = 200_000
MAG_MAX_INTERVAL = 500_000

RESET_TIMEOUT_MAX = 7_000_000
NO_AID_TIMEOUT_MAX = 1_000_000
HGT_FUSION_TIMEOUT_MAX = 5_000_000
BAD_ACC_RESET_DELAY = 500_000


@kernel
def _same_time(ekf):
    return ekf.time_delayed_us


@kernel
def _time_of_imu(ekf):
    return ekf.imu_delayed.time_us


horizon_us = by_release(_same_time, "tells_time_by_newest_imu", _time_of_imu)
"""The time (µs) of the fusion time horizon, also where `ekf.time_delayed_us` is put ahead for an update."""


@kernel
def is_timed_out(ekf, timestamp, timeout):
    """Whether `timestamp` (µs, 0 = never) lies more than `timeout` before the fusion time horizon."""
    return timestamp == 0 or timestamp + timeout < ekf.time_delayed_us


@kernel
def is_recent(ekf, timestamp, acceptance_interval):
    """Whether `timestamp` (µs, 0 = never) lies within `acceptance_interval` of the fusion time horizon."""
    return timestamp != 0 and timestamp + acceptance_interval > ekf.time_delayed_us


@kernel
def is_newest_sample_recent(ekf, timestamp, interval):
    """Whether a sample was last buffered (µs, 0 = never) within `interval` of the newest IMU sample."""
    return timestamp != 0 and timestamp + interval > ekf.time_latest_us
