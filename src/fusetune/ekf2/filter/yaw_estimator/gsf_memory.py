"""What the yaw estimator remembers: a bank of attitude filters, a bank of velocity-and-yaw filters, their weights."""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel

N_MODELS = 5

GSF_MEMORY = np.dtype(
    [
        ("tilt_aligned", "?"),
        ("vel_fuse_started", "?"),
        ("true_airspeed", "f8"),
        ("accel_lpf", "f8", (3,)),
        # attitude filter of each model
        ("q", "f8", (N_MODELS, 4)),
        ("gyro_bias", "f8", (N_MODELS, 3)),
        # velocity-and-yaw filter of each model
        ("x", "f8", (N_MODELS, 3)),
        ("P", "f8", (N_MODELS, 3, 3)),
        ("innovation", "f8", (N_MODELS, 2)),
        ("nis", "f8", (N_MODELS,)),
        ("S_det_inverse", "f8", (N_MODELS,)),
        # sum of Gaussians
        ("weight", "f8", (N_MODELS,)),
        ("yaw", "f8"),
        ("yaw_variance", "f8"),
        ("R", "f8", (3, 3)),
        ("R_aligned", "f8", (3, 3)),
    ],
    align=True,
)
"""Sub-record `ekf.gsf`. `x` is (velocity north, velocity east, yaw) in m/s and rad; `true_airspeed` (m/s) is NaN
unless known; `yaw_variance` (rad²) is infinite until velocity fusion has started; `R` and `R_aligned` are work space.
"""


@kernel
def initialise_gsf_memory(gsf):
    """State before the first IMU sample."""
    gsf.tilt_aligned = False
    gsf.true_airspeed = np.nan
    gsf.accel_lpf[:] = 0.0
    gsf.q[:] = 0.0
    gsf.q[:, 0] = 1.0
    gsf.gyro_bias[:] = 0.0
    gsf.x[:] = 0.0
    gsf.P[:] = 0.0
    gsf.innovation[:] = 0.0
    gsf.nis[:] = 0.0
    gsf.S_det_inverse[:] = 0.0
    gsf.weight[:] = 0.0
    gsf.yaw = 0.0
    reset_gsf(gsf)


@kernel
def reset_gsf(gsf):
    """Stop the velocity-and-yaw filters; the attitude filters run on."""
    gsf.vel_fuse_started = False
    gsf.yaw_variance = np.inf


@kernel
def set_true_airspeed(gsf, true_airspeed):
    """True airspeed (m/s) for the centripetal correction of a banking fixed wing."""
    gsf.true_airspeed = true_airspeed


@kernel
def set_gyro_bias(gsf, gyro_bias, force):
    """Take over the main filter's gyro bias (rad/s): always if forced, else until the bank has started."""
    if not gsf.tilt_aligned or not gsf.vel_fuse_started or force:
        for model in range(N_MODELS):
            for axis in range(3):
                gsf.gyro_bias[model, axis] = gyro_bias[axis]
