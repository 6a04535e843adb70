"""Measurements withheld from the filter for a while: their innovations are formed, but nothing else sees them.

Whatever is withheld counts as fused for all time-outs, so the filter neither resets to it nor gives it up: what the
innovations show is its own prediction.
"""

from fusetune.ekf2.compiled.kernel import kernel


@kernel
def pretend_fused(ekf):
    """Renew, before an update, the time-outs of what is withheld and was fused until then."""
    sensors, cs, aid, now = ekf.sensors, ekf.cs, ekf.aid, ekf.time_delayed_us
    if sensors.gnss.withheld:
        if cs.gnss_vel:
            aid.gnss_vel.time_last_fuse = now
            ekf.time_last_hor_vel_fuse = now
            ekf.time_last_ver_vel_fuse = now
        if cs.gnss_pos:
            aid.gnss_pos.time_last_fuse = now
            ekf.time_last_hor_pos_fuse = now
        if cs.gps_hgt:
            aid.gnss_hgt.time_last_fuse = now
            ekf.time_last_hgt_fuse = now
    if sensors.baro.withheld and cs.baro_hgt:
        aid.baro_hgt.time_last_fuse = now
        ekf.time_last_hgt_fuse = now
    if sensors.mag.withheld and cs.mag:
        aid.mag.time_last_fuse = now
        if cs.mag_hdg or cs.mag_3d:
            ekf.time_last_heading_fuse = now
