"""Variances of the field states at their start.

Mirrors `resetMagCov` of PX4 v1.15 `EKF/covariance.cpp`, which v1.16 has for earth and body field apart.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.covariance import reset_mag_bias_cov, reset_mag_earth_cov
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


reset_field_covariance = by_release(_reset_both, "limits_declination", _reset_both_and_forget_declination)
"""Forget what is known of earth and body field."""
