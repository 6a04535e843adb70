"""Covariance of the field states at their start and, until v1.14, while they are not estimated.

Mirrors `resetMagCov`, `clearMagCov`, `saveMagCovData` and `loadMagCovData` of PX4 v1.14 `EKF/covariance.cpp` and
`EKF/ekf_helper.cpp`; v1.16 has `resetMagCov` for earth and body field apart.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.covariance import reset_mag_bias_cov, reset_mag_earth_cov
from fusetune.ekf2.filter.quaternion_core.field_covariance import save_field_covariance, zero_field_covariance
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
def clear_field_covariance(ekf):
    """The field states are not estimated, and their declination is not known when they will be."""
    zero_field_covariance(ekf)
    ekf.field_history.declination_fused = False
