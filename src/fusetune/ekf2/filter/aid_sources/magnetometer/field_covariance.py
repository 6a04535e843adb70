"""Covariance of the field states at their start and, until v1.14, while they are not estimated.

Mirrors `resetMagCov`, `clearMagCov`, `saveMagCovData` and `loadMagCovData` of PX4 v1.14 `EKF/covariance.cpp` and
`EKF/ekf_helper.cpp`; v1.16 has `resetMagCov` for earth and body field apart.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.state import MAG_BODY, MAG_EARTH
from fusetune.ekf2.filter.covariance import reset_covariance_block, reset_mag_bias_cov, reset_mag_earth_cov
from fusetune.ekf2.releases.by_release import by_release


@kernel
def _reset_both(ekf, params):
    reset_mag_earth_cov(ekf, params)
    reset_mag_bias_cov(ekf, params)


@kernel
def _reset_both_and_forget_declination(ekf, params):
    """As v1.16; what was learnt of the declination is forgotten with the covariance."""
    _reset_both(ekf, params)
    ekf.field_history.declination_fused = False


@kernel
def _reset_both_or_save(ekf, params):
    """As v1.15; while the field is not fused the covariance is for when it will be."""
    _reset_both_and_forget_declination(ekf, params)
    if not ekf.cs.mag_3d:
        save_field_covariance(ekf)


reset_field_covariance = by_release(
    by_release(_reset_both, "limits_declination", _reset_both_and_forget_declination),
    "fuses_heading_or_field",
    _reset_both_or_save,
)
"""Forget what is known of earth and body field."""


@kernel
def zero_field_covariance(ekf):
    """The field states are not estimated."""
    reset_covariance_block(ekf, MAG_EARTH, 6, 0.0)


@kernel
def clear_field_covariance(ekf):
    """The field states are not estimated, and their declination is not known when they will be."""
    zero_field_covariance(ekf)
    ekf.field_history.declination_fused = False


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
