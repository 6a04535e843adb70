"""Covariance of the field states at their start.

Mirrors `resetMagCov` of PX4 v1.15 `EKF/covariance.cpp`, which v1.16 has for earth and body field apart, and
`clearMagCov` of PX4 v1.14; how that keeps it while the field is not estimated stands in
`quaternion_core/field_covariance.py`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.covariance_blocks import zero_covariance_block
from fusetune.ekf2.filter.common.state import MAG_EARTH
from fusetune.ekf2.filter.covariance import reset_mag_bias_cov, reset_mag_earth_cov
from fusetune.ekf2.filter.quaternion_core.field_covariance import reset_field_covariance as reset_kept_field_covariance
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
def _reset_or_keep(ekf, params):
    """While the field is not fused, its covariance is for when it will be."""
    reset_kept_field_covariance(ekf, params)
    ekf.field_history.declination_fused = False


reset_field_covariance = by_release(
    by_release(_reset_both, "limits_declination", _reset_both_and_forget_declination),
    "adds_quaternion_errors",
    _reset_or_keep,
)
"""Forget what is known of earth and body field."""


@kernel
def clear_field_covariance(ekf):
    """The field states are not estimated, and their declination is not known when they will be."""
    zero_covariance_block(ekf, MAG_EARTH, 6)
    ekf.field_history.declination_fused = False
