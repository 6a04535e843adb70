"""When the range finder aids the terrain, the height, or both, and what is reset to it.

`cs.rng_terrain`: the distance corrects the terrain state. `cs.rng_hgt`: it corrects the height, always (EKF2_RNG_CTRL
2) or only low and slow (1). With the range finder as height reference, the ground itself becomes the datum.

Mirrors PX4 v1.16 `EKF/aid_sources/range_finder/range_height_control.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.range_finder.range_finder_consistency_check import (
    MIN_VZ_FOR_VALID_CONSISTENCY,
    MISTAKEN_MOTION_HOLD,
    MOTION_HOLD,
    update_range_consistency,
)
from fusetune.ekf2.filter.aid_sources.range_finder.range_height_fusion import (
    fuse_hagl_rng,
    reset_terrain_to_rng,
    update_range_hagl,
)
from fusetune.ekf2.filter.aid_sources.range_finder.range_memory import dist_bottom, is_data_healthy, update_cos_tilt
from fusetune.ekf2.filter.aid_sources.range_finder.sensor_range_finder import run_range_sensor_checks
from fusetune.ekf2.filter.common.aid_source_status import reset_aid_source_status_zero_innovation
from fusetune.ekf2.filter.common.conditions import (
    get_hagl,
    is_height_reset_required,
    is_horizontal_aiding_active,
    is_terrain_estimate_valid,
    is_vertical_velocity_aiding_active,
)
from fusetune.ekf2.filter.common.height_reference import HEIGHT_REF_RANGE, give_up_height_reference
from fusetune.ekf2.filter.common.state import VELOCITY
from fusetune.ekf2.filter.common.timing import (
    HGT_FUSION_TIMEOUT_MAX,
    RNG_MAX_INTERVAL,
    horizon_us,
    is_newest_sample_recent,
    is_timed_out,
)
from fusetune.ekf2.filter.resets.state_resets import reset_altitude_to, reset_vertical_velocity_to_zero
from fusetune.ekf2.numerics.lever_arm import position_relative_to_imu
from fusetune.ekf2.numerics.rotations import component_in_earth
from fusetune.ekf2.releases.by_release import by_release

RNG_CTRL_CONDITIONAL, RNG_CTRL_ENABLED = 1, 2
RANGE_VARIANCE_MIN = 0.001
START_HYSTERESIS = 0.7
START_TEST_RATIO = 0.01


@kernel
def control_range_hagl_fusion(ekf, params):
    """Process the range sample that reached the fusion time horizon, if any, and watch over the sensor."""
    if not ekf.sensors.range.exists:
        return
    check_range_sensor(ekf, params)
    if ekf.sensors.range.data_ready:
        update_range_hagl(ekf, params)
        _control_with_sample(ekf, params)
    elif (ekf.cs.rng_hgt or ekf.cs.rng_terrain) and not has_recent_range(ekf):
        stop_rng_hgt_fusion(ekf)
        stop_rng_terr_fusion(ekf)


@kernel
def has_recent_range(ekf):
    """Whether samples still come."""
    return is_newest_sample_recent(ekf, ekf.sensors.range.newest_time_us, 2 * RNG_MAX_INTERVAL)


@kernel
def check_range_sensor(ekf, params):
    """Run the sensor's checks; a healthy sample is moved to the IMU and tested against the vertical velocity."""
    rng, R = ekf.range, ekf.R_to_earth
    rng.is_sample_ready = ekf.sensors.range.data_ready
    if ekf.sensors.range.data_ready:
        rng.sample = ekf.sensors.range.sample
    update_cos_tilt(rng, R, params.EKF2_RNG_PITCH)
    _run_checks(ekf, params)

    if is_data_healthy(rng):
        x, y, z = position_relative_to_imu(params, params.EKF2_RNG_POS_X, params.EKF2_RNG_POS_Y, params.EKF2_RNG_POS_Z)
        rng.sample.range += component_in_earth(R, 2, x, y, z) / rng.cos_tilt
        if ekf.cs.in_air:
            _check_consistency(ekf, params)
    elif _may_stand(ekf) and rng.is_regularly_sending_data and rng.is_sample_ready:
        # standing on the ground the distance is known, whatever the sensor says
        rng.sample.range = params.EKF2_MIN_RNG
        rng.is_sample_valid = True
    ekf.cs.rng_kin_consistent = rng.is_kinematically_consistent


@kernel
def _check_with_fog(ekf, params):
    run_range_sensor_checks(ekf.range, ekf.time_delayed_us, params.EKF2_RNG_QLTY_T, params.EKF2_RNG_FOG)


@kernel
def _check_unless_faulty(ekf, params):
    """As v1.16's, but no fog is looked for, and a sensor once found faulty stays out."""
    rng = ekf.range
    run_range_sensor_checks(rng, horizon_us(ekf), params.EKF2_RNG_QLTY_T, 0.0)
    if ekf.terrain_filter.range_is_faulty:
        rng.is_sample_valid = False
        rng.is_regularly_sending_data = False


_run_checks = by_release(_check_with_fog, "sees_no_fog", _check_unless_faulty)


@kernel
def _is_on_ground(ekf):
    return not ekf.cs.in_air


@kernel
def _is_at_rest_on_ground(ekf):
    return not ekf.cs.in_air and ekf.cs.vehicle_at_rest


@kernel
def _never(ekf):
    return False


_may_stand = by_release(
    by_release(_is_on_ground, "skips_unhealthy_range", _is_at_rest_on_ground), "compares_range_in_slow_flight", _never
)


@kernel
def _mistaken_hold(ekf):
    return MISTAKEN_MOTION_HOLD


@kernel
def _intended_hold(ekf):
    return MOTION_HOLD


_motion_hold_us = by_release(_mistaken_hold, "holds_range_motion", _intended_hold)


@kernel
def _compare_with_velocity(ekf, params):
    speed_squared = ekf.vel[0] * ekf.vel[0] + ekf.vel[1] * ekf.vel[1]
    speed_variance = ekf.P[VELOCITY, VELOCITY] + ekf.P[VELOCITY + 1, VELOCITY + 1]
    horizontal_motion = ekf.cs.fixed_wing or speed_squared > max(speed_variance, 0.1)
    distance = dist_bottom(ekf.range)
    scaled = params.EKF2_RNG_SFE * distance
    update_range_consistency(
        ekf.range,
        distance,
        max(params.EKF2_RNG_NOISE * params.EKF2_RNG_NOISE + scaled * scaled, RANGE_VARIANCE_MIN),
        ekf.vel[2],
        ekf.P[VELOCITY + 2, VELOCITY + 2],
        horizontal_motion,
        _motion_hold_us(ekf),
        ekf.time_delayed_us,
        params.EKF2_RNG_K_GATE,
    )


@kernel
def _compare_and_judge_in_climb(ekf, params):
    """As v1.16's, but without vertical motion the verdict stays."""
    rng = ekf.range
    verdict, since = rng.is_kinematically_consistent, rng.kin_time_last_inconsistent
    _compare_with_velocity(ekf, params)
    if abs(ekf.vel[2]) < MIN_VZ_FOR_VALID_CONSISTENCY:
        rng.is_kinematically_consistent = verdict
        rng.kin_time_last_inconsistent = since


@kernel
def _compare_in_slow_flight(ekf, params):
    """A multicopter that does not move horizontally; else the distances are not compared at all."""
    speed_squared = ekf.vel[0] * ekf.vel[0] + ekf.vel[1] * ekf.vel[1]
    speed_variance = ekf.P[VELOCITY, VELOCITY] + ekf.P[VELOCITY + 1, VELOCITY + 1]
    if not ekf.cs.fixed_wing and speed_squared < max(speed_variance, 0.1):
        _compare_with_velocity(ekf, params)


_check_consistency = by_release(
    by_release(_compare_with_velocity, "judges_range_in_climb", _compare_and_judge_in_climb),
    "compares_range_in_slow_flight",
    _compare_in_slow_flight,
)


@kernel
def _is_range_wanted(ekf, params):
    """Whether range may aid at all now, whatever the sensor says of the sample."""
    aid = ekf.aid.rng_hgt
    return (
        int(params.EKF2_RNG_CTRL) in (RNG_CTRL_ENABLED, RNG_CTRL_CONDITIONAL)
        and ekf.cs.tilt_align
        and math.isfinite(aid.observation[0])
        and math.isfinite(aid.observation_variance[0])
    )


@kernel
def _choose_height_aiding(ekf, params, may_start):
    """Let range aid the height where its parameter and the flight allow; return whether it does so conditionally."""
    cs, ctrl = ekf.cs, int(params.EKF2_RNG_CTRL)
    aiding = cs.rng_terrain or cs.rng_hgt
    conditional_aid = aiding and ctrl == RNG_CTRL_CONDITIONAL and is_conditional_range_aid_suitable(ekf, params)
    full_aid = aiding and ctrl == RNG_CTRL_ENABLED
    if cs.rng_hgt:
        if not (conditional_aid or full_aid):
            stop_rng_hgt_fusion(ekf)
    elif may_start and (conditional_aid or full_aid):
        _start_height_aiding(ekf, params, conditional_aid)
    return conditional_aid


@kernel
def _control_with_every_sample(ekf, params):
    """Choose between height and terrain, then fuse, reset, start or stop."""
    rng = ekf.range
    continuing = _is_range_wanted(ekf, params) and is_data_healthy(rng) and rng.is_kinematically_consistent
    starting = continuing and has_recent_range(ekf) and rng.is_regularly_sending_data
    _choose_height_aiding(ekf, params, True)
    if ekf.cs.rng_hgt or ekf.cs.rng_terrain:
        if continuing:
            _fuse_or_recover(ekf, params)
        else:
            stop_rng_hgt_fusion(ekf)
            stop_rng_terr_fusion(ekf)
    elif starting:
        _start_terrain_aiding(ekf, params)


@kernel
def _control_with_healthy_samples(ekf, params):
    """As v1.16's, but a sample that is not healthy, or not consistent, is left out, and stops nothing."""
    rng = ekf.range
    continuing = _is_range_wanted(ekf, params)
    starting = continuing and has_recent_range(ekf) and rng.is_regularly_sending_data and is_data_healthy(rng)
    conditional_aid = _choose_height_aiding(ekf, params, starting)
    if ekf.cs.rng_hgt or ekf.cs.rng_terrain:
        if continuing:
            _follow_conditional_reference(ekf, conditional_aid)
            _fuse_healthy_or_recover(ekf, params, starting)
        else:
            stop_rng_hgt_fusion(ekf)
            stop_rng_terr_fusion(ekf)
    elif starting:
        _start_terrain_aiding(ekf, params)


@kernel
def _follow_conditional_reference(ekf, conditional_aid):
    """While range aids low and slow it is the height reference; else the reference is chosen anew at every sample."""
    if conditional_aid:
        ekf.height_sensor_ref = HEIGHT_REF_RANGE
    else:
        give_up_height_reference(ekf, HEIGHT_REF_RANGE)


@kernel
def _fuse_healthy_or_recover(ekf, params, starting):
    aid = ekf.aid.rng_hgt
    if is_data_healthy(ekf.range) and ekf.cs.rng_kin_consistent:
        fuse_hagl_rng(ekf, params, ekf.cs.rng_hgt, ekf.cs.rng_terrain)
    leading = ekf.cs.rng_hgt and ekf.height_sensor_ref == HEIGHT_REF_RANGE
    if is_height_reset_required(ekf) and leading and starting:
        _reset_height(ekf, params)
    elif is_timed_out(ekf, aid.time_last_fuse, HGT_FUSION_TIMEOUT_MAX):
        if ekf.cs.opt_flow_terrain and is_terrain_estimate_valid(ekf):
            stop_rng_hgt_fusion(ekf)
            stop_rng_terr_fusion(ekf)
        elif starting:
            reset_terrain_to_rng(ekf, params)


_control_with_sample = by_release(_control_with_every_sample, "skips_unhealthy_range", _control_with_healthy_samples)


@kernel
def _start_height_aiding(ekf, params, conditional_aid):
    """Let the distance correct the height; as unconditional height reference it also becomes the altitude."""
    aid = ekf.aid.rng_hgt
    is_reference = int(params.EKF2_HGT_REF) == HEIGHT_REF_RANGE
    ekf.cs.rng_hgt = True
    if is_reference:
        ekf.height_sensor_ref = HEIGHT_REF_RANGE
        stop_rng_terr_fusion(ekf)
    if is_reference and not conditional_aid:
        ekf.events.reset_hgt_to_rng = True
        reset_altitude_to(ekf, params, aid.observation[0], aid.observation_variance[0])
        ekf.terrain = 0.0
        reset_aid_source_status_zero_innovation(ekf, aid, 1)
    elif not ekf.cs.opt_flow_terrain and aid.innovation_rejected:
        reset_terrain_to_rng(ekf, params)


@kernel
def _fuse_or_recover(ekf, params):
    """Fuse; when that fails too long, reset the height (as the reference of last resort) or the terrain."""
    aid = ekf.aid.rng_hgt
    fuse_hagl_rng(ekf, params, ekf.cs.rng_hgt, ekf.cs.rng_terrain)
    is_fusion_failing = is_timed_out(ekf, aid.time_last_fuse, HGT_FUSION_TIMEOUT_MAX)

    if is_height_reset_required(ekf) and ekf.cs.rng_hgt and ekf.height_sensor_ref == HEIGHT_REF_RANGE:
        _reset_height(ekf, params)
    elif is_fusion_failing:
        if ekf.cs.opt_flow_terrain and is_terrain_estimate_valid(ekf):
            stop_rng_hgt_fusion(ekf)
            stop_rng_terr_fusion(ekf)
        else:
            reset_terrain_to_rng(ekf, params)


@kernel
def _reset_height(ekf, params):
    """All height sources fail: take that above the terrain for the height, and no vertical motion."""
    ekf.events.reset_hgt_to_rng = True
    reset_altitude_to(ekf, params, ekf.aid.rng_hgt.observation[0] - ekf.terrain, math.nan)
    reset_aid_source_status_zero_innovation(ekf, ekf.aid.rng_hgt, 1)
    if not is_vertical_velocity_aiding_active(ekf):
        reset_vertical_velocity_to_zero(ekf, params)


@kernel
def _start_terrain_aiding(ekf, params):
    """Begin terrain fusion: optical flow's terrain must agree, any other is reset if it does not."""
    rejected = ekf.aid.rng_hgt.innovation_rejected
    if ekf.cs.opt_flow_terrain:
        if not rejected:
            ekf.cs.rng_terrain = True
            fuse_hagl_rng(ekf, params, ekf.cs.rng_hgt, ekf.cs.rng_terrain)
        return
    if rejected:
        reset_terrain_to_rng(ekf, params)
    ekf.cs.rng_terrain = True


@kernel
def is_conditional_range_aid_suitable(ekf, params):
    """Whether the vehicle is low and slow enough, over ground steady enough, for range to aid the height.

    Starting takes 70 % of EKF2_RNG_A_HMAX and EKF2_RNG_A_VMAX, and a test ratio a hundred times smaller.
    """
    scale, test_ratio_max = 1.0, 1.0
    if not ekf.cs.rng_hgt:
        scale, test_ratio_max = START_HYSTERESIS, START_TEST_RATIO
    if get_hagl(ekf) >= scale * params.EKF2_RNG_A_HMAX or ekf.aid.rng_hgt.test_ratio[0] >= test_ratio_max:
        return False
    if is_horizontal_aiding_active(ekf):
        return math.hypot(ekf.vel[0], ekf.vel[1]) <= scale * params.EKF2_RNG_A_VMAX
    return True


@kernel
def stop_rng_hgt_fusion(ekf):
    """Stop correcting the height; another source becomes the reference if this was it."""
    if ekf.cs.rng_hgt:
        give_up_height_reference(ekf, HEIGHT_REF_RANGE)
        ekf.cs.rng_hgt = False


@kernel
def stop_rng_terr_fusion(ekf):
    """Stop correcting the terrain."""
    ekf.cs.rng_terrain = False
