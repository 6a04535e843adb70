"""The heading of GNSS of v1.13, where EKF2_AID_MASK asks for it: judged only where it is fused.

Mirrors `controlGpsYawFusion` of PX4 v1.13 `EKF/control.cpp` and `EKF/gps_yaw_fusion.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.gnss.gnss_arrival import is_gnss_distrusted, is_gnss_trusted
from fusetune.ekf2.filter.aid_sources.gnss.gnss_yaw_control import (
    fuse_gnss_yaw,
    is_baseline_steep,
    retry_gnss_yaw,
    start_gnss_yaw_with_reset,
    update_gnss_yaw,
)
from fusetune.ekf2.filter.common.aid_mask import MASK_GNSS_YAW
from fusetune.ekf2.filter.common.timing import GNSS_MAX_INTERVAL, RESET_TIMEOUT_MAX, is_recent, is_timed_out
from fusetune.ekf2.filter.source_stops.yaw import stop_gnss_yaw_fusion


@kernel
def control_gnss_yaw_by_mask(ekf, params, sample):
    """Start, continue or stop with a sample, which may tell no heading."""
    cs, taken = ekf.cs, ekf.gnss_taken
    if int(params.EKF2_AID_MASK) & MASK_GNSS_YAW == 0 or cs.gnss_yaw_fault:
        stop_gnss_yaw_fusion(ekf)
        return
    if math.isfinite(sample.yaw):
        continuing, recent = not is_gnss_distrusted(ekf), is_recent(ekf, taken.yaw_time_us, 2 * GNSS_MAX_INTERVAL)
        starting = continuing and cs.tilt_align and is_gnss_trusted(ekf) and recent and not ekf.gnss.intermittent
        taken.yaw_time_us = ekf.time_delayed_us
        if cs.gnss_yaw and not continuing:
            stop_gnss_yaw_fusion(ekf)
        elif cs.gnss_yaw:
            _fuse(ekf, params, sample, starting)
        elif starting:
            start_gnss_yaw_with_reset(ekf, params, sample)
            cs.ev_yaw = cs.ev_yaw and not cs.gnss_yaw
    elif cs.gnss_yaw and is_timed_out(ekf, taken.yaw_time_us, RESET_TIMEOUT_MAX):
        stop_gnss_yaw_fusion(ekf)
    if not cs.in_air and not cs.gnss_yaw and ekf.cs_prev.gnss_yaw:
        cs.yaw_align = False


@kernel
def _fuse(ekf, params, sample, may_start):
    """Judge and fuse, unless the baseline of the antennas is too steep to tell a heading."""
    if not is_baseline_steep(ekf, sample.yaw_offset):
        update_gnss_yaw(ekf, params, sample)
        fuse_gnss_yaw(ekf, params, sample.yaw_offset)
    retry_gnss_yaw(ekf, params, sample, may_start)
