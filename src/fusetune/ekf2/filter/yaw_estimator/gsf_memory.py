"""What the yaw estimator remembers: a bank of attitude filters, a bank of velocity-and-yaw filters, their weights.

The models lie side by side: a quantity's last index is the model, so that the processor works on all of them at once.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel

N_MODELS = 5

LANES = 8
"""The models, and idle ones up to the width of vector registers, which are predicted along and count for nothing."""

P_VN_VN, P_VN_VE, P_VN_YAW, P_VE_VE, P_VE_YAW, P_YAW_YAW = range(6)
"""Rows of the covariance `gsf.P`: the upper triangle of each model's matrix."""

GSF_MEMORY = np.dtype(
    [
        ("tilt_aligned", "?"),
        ("vel_fuse_started", "?"),
        ("true_airspeed", "f8"),
        ("accel_lpf", "f8", (3,)),
        # attitude filter of each model
        ("q", "f8", (4, LANES)),
        ("gyro_bias", "f8", (3, LANES)),
        ("rotation", "f8", (3, LANES)),
        ("rotation_squared", "f8", (LANES,)),
        # velocity-and-yaw filter of each model
        ("x", "f8", (3, LANES)),
        ("P", "f8", (6, LANES)),
        ("innovation", "f8", (2, LANES)),
        ("nis", "f8", (LANES,)),
        ("S_det_inverse", "f8", (LANES,)),
        # sum of Gaussians
        ("weight", "f8", (N_MODELS,)),
        ("yaw", "f8"),
        ("yaw_variance", "f8"),
        ("R", "f8", (3, 3)),
        ("R_aligned", "f8", (3, 3)),
        ("q_aligned", "f8", (4,)),
    ],
    align=True,
)
"""Sub-record `ekf.gsf`. `x` is (velocity north, velocity east, yaw) in m/s and rad; `true_airspeed` (m/s) is NaN
unless known; `yaw_variance` (rad²) is infinite until velocity fusion has started; `rotation` (rad, body) is that of
the last sample; `rotation_squared`, `R`, `R_aligned` and `q_aligned` are work space.
"""


@kernel
def initialise_gsf_memory(gsf):
    """What is not zero at start: all attitudes are level, no airspeed and no yaw is known."""
    gsf.true_airspeed = np.nan
    gsf.q[0, :] = 1.0
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
        for axis in range(3):
            gsf.gyro_bias[axis, :] = gyro_bias[axis]
