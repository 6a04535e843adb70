"""One pass over all aid sources, in the order of `controlFusionModes` of PX4 v1.16 `EKF/control.cpp`."""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.airspeed.airspeed_control import control_air_data_fusion
from fusetune.ekf2.filter.aid_sources.auxvel.auxvel_fusion import control_aux_vel_fusion
from fusetune.ekf2.filter.aid_sources.drag.drag_fusion import control_drag_fusion
from fusetune.ekf2.filter.aid_sources.external_vision.ev_control import control_external_vision_fusion
from fusetune.ekf2.filter.aid_sources.fake_height_control import control_fake_hgt_fusion
from fusetune.ekf2.filter.aid_sources.fake_position.one_fake_position import control_fake_position
from fusetune.ekf2.filter.aid_sources.gnss.gnss_fusion import control_gnss
from fusetune.ekf2.filter.aid_sources.gravity.gravity_fusion import control_gravity_fusion
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_control import control_mag_fusion
from fusetune.ekf2.filter.aid_sources.optical_flow.flow_control import control_flow_fusion
from fusetune.ekf2.filter.aid_sources.sideslip.sideslip_fusion import control_beta_fusion
from fusetune.ekf2.filter.aid_sources.zero_gyro_update import control_zero_gyro_update
from fusetune.ekf2.filter.aid_sources.zero_innovation_heading_update import control_zero_innovation_heading_update
from fusetune.ekf2.filter.aid_sources.zero_velocity_update import control_zero_velocity_update
from fusetune.ekf2.filter.common.conditions import IMU_CTRL_GYRO_BIAS, set_gnd_effect, set_in_air_status
from fusetune.ekf2.filter.common.dead_reckoning import update_dead_reckoning_status
from fusetune.ekf2.filter.common.heading_observability import update_heading_observability
from fusetune.ekf2.filter.covariance import tilt_variance
from fusetune.ekf2.filter.height_control import control_height_fusion, watch_height_first
from fusetune.ekf2.filter.resets.state_resets import remember_reset_counters
from fusetune.ekf2.filter.terrain_control import control_terrain_fake_fusion, update_terrain_validity
from fusetune.ekf2.releases.by_release import does

TILT_ALIGNED_VARIANCE = math.radians(3.0) ** 2

_knows_no_constant_position = does("knows_no_constant_position")


@kernel
def control_fusion_modes(ekf, params):
    """Let every aid source start, fuse, reset or stop, with the samples that are due."""
    ekf.cs_prev = ekf.cs
    remember_reset_counters(ekf)
    _follow_system_flags(ekf)
    if not ekf.cs.tilt_align:
        ekf.cs.tilt_align = tilt_variance(ekf) < TILT_ALIGNED_VARIANCE

    watch_height_first(ekf, params)
    control_mag_fusion(ekf, params)
    control_flow_fusion(ekf, params)
    control_gnss(ekf, params)
    control_air_data_fusion(ekf, params)
    control_beta_fusion(ekf, params)
    control_drag_fusion(ekf, params)
    control_height_fusion(ekf, params)
    control_gravity_fusion(ekf, params)
    control_external_vision_fusion(ekf, params)
    control_aux_vel_fusion(ekf, params)
    control_terrain_fake_fusion(ekf, params)
    update_terrain_validity(ekf)

    control_zero_innovation_heading_update(ekf, params)
    control_zero_velocity_update(ekf, params)
    if int(params.EKF2_IMU_CTRL) & IMU_CTRL_GYRO_BIAS:
        control_zero_gyro_update(ekf, params)
    control_fake_position(ekf, params)
    control_fake_hgt_fusion(ekf, params)
    update_dead_reckoning_status(ekf, params)
    update_heading_observability(ekf)


@kernel
def _follow_system_flags(ekf):
    """Apply what the vehicle's status and land detector said at the fusion time horizon."""
    if not ekf.sensors.system_flags.data_ready:
        return
    flags = ekf.sensors.system_flags.sample
    ekf.cs.vehicle_at_rest = flags.at_rest
    set_in_air_status(ekf, flags.in_air)
    ekf.cs.fixed_wing = flags.is_fixed_wing
    if flags.gnd_effect:
        set_gnd_effect(ekf)
    ekf.cs.constant_pos = flags.constant_pos and not _knows_no_constant_position(ekf)
