"""Measurements withheld from the filter for a while: their innovations are formed, but nothing else sees them.

Whatever is withheld counts as fused for all time-outs, so the filter neither resets to it nor gives it up: what the
innovations show is its own prediction.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.px4.aid_sources import WITHHOLDABLE

WITHHELD = np.dtype([(sensor, "?") for sensor in WITHHOLDABLE])
"""The estimator's sub-record `ekf.withheld`."""


@kernel
def pretend_gnss_fused(ekf):
    """Renew the timers of GNSS velocity and position."""
    now = ekf.time_delayed_us
    if ekf.cs.gnss_vel:
        ekf.aid.gnss_vel.time_last_fuse = now
        ekf.time_last_hor_vel_fuse = now
        ekf.time_last_ver_vel_fuse = now
    if ekf.cs.gnss_pos:
        ekf.aid.gnss_pos.time_last_fuse = now
        ekf.time_last_hor_pos_fuse = now


@kernel
def pretend_height_fused(ekf, aid, is_active):
    """Renew the timers of a source of height."""
    if is_active:
        aid.time_last_fuse = ekf.time_delayed_us
        ekf.time_last_hgt_fuse = ekf.time_delayed_us


@kernel
def pretend_mag_fused(ekf):
    """Renew the timers of the magnetometer."""
    if ekf.cs.mag:
        ekf.aid.mag.time_last_fuse = ekf.time_delayed_us
        if ekf.cs.mag_hdg or ekf.cs.mag_3d:
            ekf.time_last_heading_fuse = ekf.time_delayed_us
