"""Optical flow corrects the terrain, each axis by itself and gated by itself.

Mirrors PX4 v1.13 `EKF/terrain_estimator.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.optical_flow.flow_over_terrain import predict_flow_velocity
from fusetune.ekf2.filter.aid_sources.optical_flow.optical_flow_fusion import calc_opt_flow_meas_var
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.conditions import TERRAIN_TIMEOUT, get_hagl
from fusetune.ekf2.filter.common.timing import horizon_us, is_timed_out
from fusetune.ekf2.filter.terrain_filter.terrain_by_flow import DATA_STOPPED_US, TERR_MASK_FLOW


@kernel
def control_terrain_by_flow_axes(ekf, params):
    """Fuse flow that the main filter does not use, where GNSS aids in flight and range has not told for 5 s."""
    terrain = ekf.terrain_filter
    if not int(params.EKF2_TERR_MASK) & TERR_MASK_FLOW:
        terrain.uses_flow = False
    elif terrain.flow_is_good:
        unseen = is_timed_out(ekf, ekf.aid.terrain_range_finder.time_last_fuse, TERRAIN_TIMEOUT)
        aided = ekf.cs.gnss_pos or ekf.cs.gnss_vel
        terrain.uses_flow = ekf.cs.in_air and not ekf.cs.opt_flow and aided and unseen
        if terrain.uses_flow:
            _fuse_axes(ekf, params)
            terrain.flow_is_good = False
    elif terrain.uses_flow and horizon_us(ekf) > ekf.sensors.flow.sample.time_us + DATA_STOPPED_US:
        terrain.uses_flow = False


@kernel
def _fuse_axes(ekf, params):
    """Both axes are linearised where the first was; an axis beyond the gate is left out."""
    terrain, aid = ekf.terrain_filter, ekf.aid.terrain_optical_flow
    ekf.terrain = max(ekf.terrain, params.EKF2_MIN_RNG - ekf.gpos_alt)
    hagl, gate = get_hagl(ekf), max(params.EKF2_OF_GATE, 1.0)
    noise = calc_opt_flow_meas_var(params, ekf.sensors.flow.sample.quality)
    forward, right = predict_flow_velocity(ekf, params)
    cos_tilt = ekf.R_to_earth[2, 2]
    for axis in range(2):
        velocity = right if axis == 0 else -forward
        by_terrain = velocity * cos_tilt / (hagl * hagl)
        innovation_variance = terrain.variance * by_terrain * by_terrain + noise
        innovation = velocity * cos_tilt / hagl - ekf.flow.rate_compensated[axis]
        set_axis(aid, axis, ekf.flow.rate_compensated[axis], noise, innovation, innovation_variance)
        if innovation * innovation <= gate * gate * innovation_variance:
            gain = terrain.variance * by_terrain / innovation_variance
            ekf.terrain += gain * innovation
            terrain.variance = max(terrain.variance * (1.0 - gain * by_terrain), 0.0)
            aid.time_last_fuse = ekf.time_delayed_us
    update_aid_source_status(ekf, aid, 2, ekf.sensors.flow.sample.time_us, gate)
    aid.fused = aid.time_last_fuse == ekf.time_delayed_us
