"""Covariance of the field states while they are not estimated: zero, and what it was is kept until they are again.

Mirrors `zeroMagCov`, `saveMagCovData` and `loadMagCovData` of PX4 v1.14 `EKF/covariance.cpp` and `EKF/ekf_helper.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.covariance_blocks import zero_covariance_block
from fusetune.ekf2.filter.common.state import MAG_BODY, MAG_EARTH


@kernel
def zero_field_covariance(ekf):
    """The field states are not estimated."""
    zero_covariance_block(ekf, MAG_EARTH, 6)


@kernel
def save_field_covariance(ekf):
    """Keep the variances, and the covariance of the horizontal earth field, for when the field is fused again."""
    P, modes = ekf.P, ekf.mag_modes
    for i in range(3):
        modes.saved_body_variance[i] = P[MAG_BODY + i, MAG_BODY + i]
    for i in range(2):
        for j in range(2):
            modes.saved_horizontal_covariance[i, j] = P[MAG_EARTH + i, MAG_EARTH + j]
    modes.saved_down_variance = P[MAG_EARTH + 2, MAG_EARTH + 2]


@kernel
def restore_field_covariance(ekf):
    """The field states have the variances again that were kept."""
    zero_field_covariance(ekf)
    P, modes = ekf.P, ekf.mag_modes
    for i in range(3):
        P[MAG_BODY + i, MAG_BODY + i] = modes.saved_body_variance[i]
    for i in range(2):
        for j in range(2):
            P[MAG_EARTH + i, MAG_EARTH + j] = modes.saved_horizontal_covariance[i, j]
    P[MAG_EARTH + 2, MAG_EARTH + 2] = modes.saved_down_variance
