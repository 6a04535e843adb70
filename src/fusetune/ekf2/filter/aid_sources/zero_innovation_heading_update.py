"""Keep the yaw variance bounded while nothing observes the heading.

Mirrors PX4 v1.16 `EKF/aid_sources/zero_innovation_heading_update.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.state import ERROR_STATE_SIZE
from fusetune.ekf2.filter.common.timing import is_timed_out
from fusetune.ekf2.filter.covariance import initialise_covariance
from fusetune.ekf2.filter.measurement_update import measurement_update
from fusetune.ekf2.filter.observation_gain import multiply_covariance
from fusetune.ekf2.filter.yaw_fusion import compute_yaw_innov_var_and_h
from fusetune.ekf2.releases.by_release import by_release

UPDATE_INTERVAL_US = 200_000
VARIANCE_WHILE_LEVELLING = 0.001
VARIANCE_AFTERWARDS = 0.25


@kernel
def _control_zero_innovation_heading_update(ekf, params):
    """Fuse a heading innovation of zero every 0.2 s, always while levelling, later only if the variance is large."""
    yaw_aiding = ekf.cs.mag_hdg or ekf.cs.mag_3d or ekf.cs.ev_yaw or ekf.cs.gnss_yaw
    if yaw_aiding or not is_timed_out(ekf, ekf.time_last_heading_fuse, UPDATE_INTERVAL_US):
        return
    variance = VARIANCE_AFTERWARDS if ekf.cs.tilt_align else VARIANCE_WHILE_LEVELLING
    H, K = ekf.scratch.H, ekf.scratch.K
    innovation_variance = compute_yaw_innov_var_and_h(ekf, variance, H)
    if ekf.cs.tilt_align and innovation_variance - variance <= params.EKF2_HEAD_NOISE**2:
        return
    if not innovation_variance >= variance:
        ekf.fs.bad_hdg = True
        initialise_covariance(ekf, params)
        return
    multiply_covariance(ekf, H)
    for i in range(ERROR_STATE_SIZE):
        K[i] = ekf.scratch.PH[i] / innovation_variance
    ekf.fs.bad_hdg = False
    ekf.reject.yaw = False
    measurement_update(ekf, params, variance, 0.0)
    ekf.time_last_heading_fuse = ekf.time_delayed_us


@kernel
def _hold_heading_otherwise(ekf, params):
    """A heading that nothing observes is held where gains and covariance are made."""


control_zero_innovation_heading_update = by_release(
    _control_zero_innovation_heading_update, "holds_unobservable_heading", _hold_heading_otherwise
)
