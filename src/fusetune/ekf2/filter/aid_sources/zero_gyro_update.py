"""The gyro at rest measures its own bias.

Mirrors PX4 v1.16 `EKF/aid_sources/ZeroGyroUpdate.cpp`.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.state import GYRO_BIAS
from fusetune.ekf2.filter.measurement_update import fuse_direct_state
from fusetune.ekf2.releases.by_release import by_release

ZERO_GYRO_MEMORY = np.dtype([("delta_ang", "f8", (3,)), ("delta_ang_dt", "f8")], align=True)

MEAN_OVER_S = 0.2


@kernel
def reset_zero_gyro(ekf):
    """Start a new mean."""
    for i in range(3):
        ekf.zero_gyro.delta_ang[i] = 0.0
    ekf.zero_gyro.delta_ang_dt = 0.0


@kernel
def _fuse_mean_rate(ekf, params):
    if not ekf.cs.vehicle_at_rest:
        reset_zero_gyro(ekf)
        return
    mean, imu = ekf.zero_gyro, ekf.imu_delayed
    for i in range(3):
        mean.delta_ang[i] += imu.delta_ang[i]
    # summed in single precision, which decides after how many samples 0.2 s are full
    mean.delta_ang_dt = float(np.float32(mean.delta_ang_dt) + np.float32(imu.delta_ang_dt))
    if np.float32(mean.delta_ang_dt) < np.float32(MEAN_OVER_S):
        return
    variance = min(max(params.EKF2_GYR_NOISE, 0.0), 1.0) ** 2
    for i in range(3):
        innovation = ekf.gyro_bias[i] - mean.delta_ang[i] / mean.delta_ang_dt
        innovation_variance = ekf.P[GYRO_BIAS + i, GYRO_BIAS + i] + variance
        fuse_direct_state(ekf, params, innovation, innovation_variance, variance, GYRO_BIAS + i)
    reset_zero_gyro(ekf)


@kernel
def _measure_no_bias(ekf, params):
    """Before v1.15 the bias is told by the heading alone."""


control_zero_gyro_update = by_release(_fuse_mean_rate, "measures_no_gyro_bias", _measure_no_bias)
"""While at rest, fuse the mean rate over 0.2 s as an observation of the gyro bias."""
