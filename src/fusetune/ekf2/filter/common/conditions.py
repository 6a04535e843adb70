"""What is aiding the filter now, and whether its estimates can be relied on: questions every aid source asks.

Mirrors the questions of PX4 v1.16 `EKF/estimator_interface.cpp` and `EKF/ekf_helper.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.timing import BAD_ACC_RESET_DELAY, HGT_FUSION_TIMEOUT_MAX, is_recent, is_timed_out
from fusetune.ekf2.releases.by_release import by_release

TERRAIN_TIMEOUT = 5_000_000

IMU_CTRL_GYRO_BIAS = 1
IMU_CTRL_ACCEL_BIAS = 2
IMU_CTRL_GRAVITY_VECTOR = 4


@kernel
def get_number_of_active_horizontal_position_aiding_sources(ekf):
    """How many sources give horizontal position."""
    return int(ekf.cs.gnss_pos) + int(ekf.cs.ev_pos) + int(ekf.cs.aux_gpos)


@kernel
def _count_gnss_velocity(ekf):
    return int(ekf.cs.gnss_vel)


@kernel
def _count_with_position(ekf):
    """GNSS is one source, which the position counts."""
    return 0


_number_of_gnss_velocities = by_release(_count_gnss_velocity, "aids_by_one_gnss_flag", _count_with_position)


@kernel
def get_number_of_active_horizontal_velocity_aiding_sources(ekf):
    """How many sources give horizontal velocity; airspeed and sideslip together count as one."""
    return (
        _number_of_gnss_velocities(ekf)
        + int(ekf.cs.opt_flow)
        + int(ekf.cs.ev_vel)
        + int(ekf.cs.fuse_aspd and ekf.cs.fuse_beta)
    )


@kernel
def get_number_of_active_horizontal_aiding_sources(ekf):
    """How many sources bound the horizontal drift."""
    return get_number_of_active_horizontal_position_aiding_sources(
        ekf
    ) + get_number_of_active_horizontal_velocity_aiding_sources(ekf)


@kernel
def is_other_source_than(sources, aiding_flag):
    """Whether there is a source besides the one whose flag is given."""
    if aiding_flag:
        return sources > 1
    return sources > 0


@kernel
def is_horizontal_aiding_active(ekf):
    """Whether any source bounds the horizontal drift."""
    return get_number_of_active_horizontal_aiding_sources(ekf) > 0


@kernel
def is_other_source_of_horizontal_aiding_than(ekf, aiding_flag):
    """Whether a source other than the one with this flag bounds the horizontal drift."""
    return is_other_source_than(get_number_of_active_horizontal_aiding_sources(ekf), aiding_flag)


@kernel
def is_only_active_source_of_horizontal_aiding(ekf, aiding_flag):
    """Whether the source with this flag alone bounds the horizontal drift."""
    return aiding_flag and not is_other_source_of_horizontal_aiding_than(ekf, aiding_flag)


@kernel
def get_number_of_active_vertical_position_aiding_sources(ekf):
    """How many height sources are fused."""
    return int(ekf.cs.gps_hgt) + int(ekf.cs.baro_hgt) + int(ekf.cs.rng_hgt) + int(ekf.cs.ev_hgt)


@kernel
def is_vertical_position_aiding_active(ekf):
    """Whether any height source is fused."""
    return get_number_of_active_vertical_position_aiding_sources(ekf) > 0


@kernel
def is_other_source_of_vertical_position_aiding_than(ekf, aiding_flag):
    """Whether a height source other than the one with this flag is fused."""
    return is_other_source_than(get_number_of_active_vertical_position_aiding_sources(ekf), aiding_flag)


@kernel
def is_only_active_source_of_vertical_position_aiding(ekf, aiding_flag):
    """Whether the height source with this flag is the only one fused."""
    return aiding_flag and not is_other_source_of_vertical_position_aiding_than(ekf, aiding_flag)


@kernel
def get_number_of_active_vertical_velocity_aiding_sources(ekf):
    """How many sources give vertical velocity."""
    return int(ekf.cs.gnss_vel) + int(ekf.cs.ev_vel)


@kernel
def is_vertical_velocity_aiding_active(ekf):
    """Whether any source gives vertical velocity."""
    return get_number_of_active_vertical_velocity_aiding_sources(ekf) > 0


@kernel
def is_vertical_aiding_active(ekf):
    """Whether any source gives height or vertical velocity."""
    return is_vertical_position_aiding_active(ekf) or is_vertical_velocity_aiding_active(ekf)


@kernel
def _is_gnss_aiding_active(ekf):
    """Whether a source tied to true north is fused, so that heading is observable by manoeuvring."""
    return ekf.cs.gnss_pos or ekf.cs.gnss_vel or ekf.cs.aux_gpos


@kernel
def _is_gnss_or_vision_aiding_active(ekf):
    """As v1.16's, with vision that is aligned to north."""
    return _is_gnss_aiding_active(ekf) or (ekf.cs.ev_pos and ekf.cs.yaw_align)


is_north_east_aiding_active = by_release(
    _is_gnss_aiding_active, "counts_vision_to_north_east", _is_gnss_or_vision_aiding_active
)


@kernel
def is_local_horizontal_position_valid(ekf):
    """Whether horizontal dead reckoning has not lasted too long."""
    return not ekf.horizontal_deadreckon_time_exceeded


@kernel
def is_local_vertical_position_valid(ekf):
    """Whether the height has been aided recently enough."""
    return not ekf.vertical_position_deadreckon_time_exceeded


@kernel
def is_local_vertical_velocity_valid(ekf):
    """Whether the vertical velocity has been aided recently enough."""
    return not ekf.vertical_velocity_deadreckon_time_exceeded


@kernel
def is_height_reset_required(ekf):
    """Whether height fusion has failed too long, or vertical acceleration has been bad without a break."""
    return is_timed_out(ekf, ekf.time_good_vert_accel, BAD_ACC_RESET_DELAY) or is_timed_out(
        ekf, ekf.time_last_hgt_fuse, HGT_FUSION_TIMEOUT_MAX
    )


@kernel
def _is_terrain_state_valid(ekf):
    """Whether the terrain state can be used."""
    return ekf.terrain_valid


@kernel
def _is_on_ground(ekf):
    return not ekf.cs.in_air


@kernel
def _never(ekf):
    return False


_counts_on_ground = by_release(_is_on_ground, "sees_terrain_in_air", _never)


@kernel
def _is_terrain_aided(ekf):
    """Whether the filter of the terrain was corrected within 5 s: by flow, or by range (on the ground, or started)."""
    terrain, aid = ekf.terrain_filter, ekf.aid
    by_range = (terrain.uses_range or _counts_on_ground(ekf)) and is_recent(
        ekf, aid.terrain_range_finder.time_last_fuse, TERRAIN_TIMEOUT
    )
    return by_range or (terrain.uses_flow and is_recent(ekf, aid.terrain_optical_flow.time_last_fuse, TERRAIN_TIMEOUT))


is_terrain_estimate_valid = by_release(
    by_release(_is_terrain_state_valid, "filters_terrain_apart", _is_terrain_aided),
    "keeps_terrain_known",
    _is_terrain_state_valid,
)


@kernel
def get_hagl(ekf):
    """Height (m) above the terrain estimate."""
    return ekf.terrain + ekf.gpos_alt


@kernel
def get_terrain_vpos(ekf):
    """Down position (m) of the terrain: estimated, or where the vehicle last stood."""
    if is_terrain_estimate_valid(ekf):
        return ekf.terrain
    return ekf.last_on_ground_pos_d


@kernel
def set_in_air_status(ekf, in_air):
    """Note whether the vehicle flies, and when it last did or did not."""
    if in_air:
        ekf.time_last_in_air = ekf.time_delayed_us
    else:
        ekf.time_last_on_ground = ekf.time_delayed_us
    ekf.cs.in_air = in_air


@kernel
def set_gnd_effect(ekf):
    """Note that rotor downwash near the ground may be raising the static pressure."""
    ekf.cs.gnd_effect = True
    ekf.time_last_gnd_effect_on = ekf.time_delayed_us


@kernel
def follow_system_flags_at_once(ekf, flags):
    """Apply what arrived of the vehicle's status or of the land detector; times are noted as flying begins or ends.

    Sideslip is that of a vehicle that was known to fly as its status arrived.
    """
    if flags.status_is_new:
        ekf.cs.fixed_wing = flags.is_fixed_wing
        ekf.cs.fuse_beta = flags.is_fixed_wing and ekf.cs.in_air
    if flags.land_is_new:
        ekf.cs.vehicle_at_rest = flags.at_rest
        if flags.gnd_effect:
            set_gnd_effect(ekf)
        if flags.in_air != ekf.cs.in_air:
            set_in_air_status(ekf, flags.in_air)
