"""The low-passed specific force: it levels the filter and, since v1.17, is followed afterwards, too."""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel

LPF_ALPHA = 0.1

LEVELLING_MEMORY = np.dtype([("specific_force", "f8", (3,)), ("begun", "?")], align=True)
"""Sub-record `ekf.levelling`: m/s², body, of the raw accelerometer; and whether an update has followed it."""


@kernel
def follow_specific_force(ekf):
    """Low-pass what the accelerometer measured at the fusion time horizon; that of the first update is in already."""
    imu, force, memory = ekf.imu_delayed, ekf.levelling.specific_force, ekf.levelling
    alpha = LPF_ALPHA
    if not memory.begun:
        memory.begun = True
        # a filter that was given its state has levelled by nothing
        alpha = 1.0 if force[0] == 0.0 and force[1] == 0.0 and force[2] == 0.0 else 0.0
    for axis in range(3):
        force[axis] += alpha * (imu.delta_vel[axis] / imu.delta_vel_dt - force[axis])
