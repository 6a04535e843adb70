"""Covariance of the field states of v1.13 and v1.14, which are estimated only in three-axis fusion.

While they are not, it is zero, and what it was is kept until they are again.

Mirrors `resetMagCov`, `saveMagCovData` and `loadMagCovData` of PX4 v1.14 `EKF/covariance.cpp` and `EKF/ekf_helper.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.covariance_blocks import reset_covariance_block
from fusetune.ekf2.filter.common.state import MAG_BODY, MAG_EARTH


@kernel
def keep_field_covariance(ekf):
    """Note what is known of the field before its covariance is zeroed."""
    P, core = ekf.P, ekf.quaternion
    for i in range(3):
        core.kept_field_bias_var[i] = P[MAG_BODY + i, MAG_BODY + i]
        core.kept_field_var[i] = P[MAG_EARTH + i, MAG_EARTH + i]
    core.kept_field_ne_cov = P[MAG_EARTH, MAG_EARTH + 1]


@kernel
def restore_field_covariance(ekf):
    """Take up what was known of the field."""
    P, core = ekf.P, ekf.quaternion
    for i in range(3):
        P[MAG_BODY + i, MAG_BODY + i] = core.kept_field_bias_var[i]
        P[MAG_EARTH + i, MAG_EARTH + i] = core.kept_field_var[i]
    P[MAG_EARTH, MAG_EARTH + 1] = P[MAG_EARTH + 1, MAG_EARTH] = core.kept_field_ne_cov


@kernel
def reset_field_covariance(ekf, params):
    """As uncertain as the magnetometer measures, for now or for when the field is estimated."""
    reset_covariance_block(ekf, MAG_EARTH, 6, params.EKF2_MAG_NOISE * params.EKF2_MAG_NOISE)
    if not ekf.cs.mag_3d:
        keep_field_covariance(ekf)


@kernel
def get_field_bias_variance(ekf, axis):
    """Variance (Gauss²) of the field's bias along a body axis."""
    if ekf.cs.mag_3d:
        return ekf.P[MAG_BODY + axis, MAG_BODY + axis]
    return ekf.quaternion.kept_field_bias_var[axis]
