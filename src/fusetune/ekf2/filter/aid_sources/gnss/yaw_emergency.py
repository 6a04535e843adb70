"""Use of the yaw estimator: aligning the yaw, noticing that it is wrong in flight, and putting it right.

Mirrors the yaw part of PX4 v1.16 `EKF/aid_sources/gnss/gps_control.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.gnss.gnss_memory import GPS_CTRL_HPOS, GPS_CTRL_VEL
from fusetune.ekf2.filter.common.timing import horizon_us
from fusetune.ekf2.filter.resets.state_resets import reset_quat_state_yaw
from fusetune.ekf2.filter.yaw_estimator.converged_yaw import is_yaw_emergency_estimate_available
from fusetune.ekf2.filter.yaw_estimator.yaw_bank import fuse_yaw_bank_velocity
from fusetune.ekf2.releases.by_release import by_release


@kernel
def _is_yaw_reset_new(ekf):
    return (
        ekf.cs_prev.yaw_align != ekf.cs.yaw_align or ekf.state_reset.quat_counter != ekf.state_reset_prev.quat_counter
    )


@kernel
def _never(ekf):
    return False


_has_yaw_been_reset = by_release(_is_yaw_reset_new, "repeats_yaw_emergency_resets", _never)


@kernel
def _reset_yaw_unless_new(ekf, params):
    """Set the yaw to the yaw estimator's, if that has converged and the yaw was not reset in this update already."""
    if not is_yaw_emergency_estimate_available(ekf):
        return False
    if _has_yaw_been_reset(ekf):
        return False
    reset_quat_state_yaw(ekf, params, ekf.gsf.yaw, ekf.gsf.yaw_variance)
    ekf.cs.yaw_align = True
    ekf.events.yaw_aligned_to_imu_gps = True
    return True


@kernel
def _reset_yaw_and_blame(ekf, params):
    """As v1.15's, in any update, with the blame that v1.15 lays in flight alone, for one of magnetometer and GNSS."""
    if not is_yaw_emergency_estimate_available(ekf):
        return False
    reset_quat_state_yaw(ekf, params, ekf.gsf.yaw, ekf.gsf.yaw_variance)
    ekf.mag.flt_mag_align_start_time = horizon_us(ekf)
    ekf.cs.yaw_align = True
    if ekf.cs.mag_hdg or ekf.cs.mag_3d:
        ekf.cs.mag_fault = True
    elif ekf.cs.gnss_yaw:
        ekf.cs.gnss_yaw_fault = True
    if ekf.cs.ev_yaw:
        ekf.gnss_arrivals.inhibits_ev_yaw = True
    return True


reset_yaw_to_ekf_gsf = by_release(_reset_yaw_unless_new, "checks_gnss_on_arrival", _reset_yaw_and_blame)


@kernel
def try_yaw_emergency_reset(ekf, params):
    """Put the yaw right in flight; the heading source that led it astray counts as faulty from then on."""
    if not reset_yaw_to_ekf_gsf(ekf, params):
        return False
    if ekf.cs.mag_hdg or ekf.cs.mag_3d:
        ekf.cs.mag_fault = True
    if ekf.cs.gnss_yaw:
        ekf.cs.gnss_yaw_fault = True
    if ekf.cs.ev_yaw:
        ekf.cs.ev_yaw_fault = True
    return True


@kernel
def _variance_as_it_is(ekf, variance):
    """v1.16 passes the variance on as if it were the accuracy, and compares that with the limit of the accuracy."""
    return variance


@kernel
def _standard_deviation(ekf, variance):
    return math.sqrt(variance)


_told_accuracy = by_release(_variance_as_it_is, "tells_yaw_estimator_deviation", _standard_deviation)


@kernel
def control_gnss_yaw_estimator(ekf, params):
    """Give the last GNSS velocity to the yaw estimator, and align the yaw by it where nothing else has."""
    aid = ekf.aid.gnss_vel
    accuracy = _told_accuracy(ekf, aid.observation_variance[0])
    if not 0.0 < accuracy < params.EKF2_REQ_SACC:
        return
    if not (np.isfinite(aid.observation[0]) and np.isfinite(aid.observation[1])):
        return
    fuse_yaw_bank_velocity(ekf, aid.observation[0], aid.observation[1], accuracy, ekf.cs.in_air)
    uses_gnss = int(params.EKF2_GPS_CTRL) & (GPS_CTRL_VEL | GPS_CTRL_HPOS) != 0
    if uses_gnss and not ekf.cs.yaw_align and ekf.cs.tilt_align:
        reset_yaw_to_ekf_gsf(ekf, params)
