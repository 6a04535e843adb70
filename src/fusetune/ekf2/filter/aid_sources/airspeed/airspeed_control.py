"""True airspeed: when it is fused, and which wind or velocity it starts from.

Mirrors PX4 v1.16 `EKF/aid_sources/airspeed/airspeed_fusion.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.airspeed.airspeed_fusion import fuse_airspeed, predict_airspeed, update_airspeed
from fusetune.ekf2.filter.aid_sources.airspeed.airspeed_resets import (
    reset_vel_using_airspeed,
    reset_wind_using_airspeed,
)
from fusetune.ekf2.filter.common.aid_source_status import forget_aid_source_status
from fusetune.ekf2.filter.common.state import WIND
from fusetune.ekf2.filter.common.timing import is_recent, is_timed_out
from fusetune.ekf2.filter.covariance import INITIAL_WIND_UNCERTAINTY
from fusetune.ekf2.filter.wind import is_drag_enabled
from fusetune.ekf2.filter.yaw_estimator.gsf_memory import set_true_airspeed
from fusetune.ekf2.releases.by_release import by_release

WIND_TIMEOUT_US = 10_000_000
LEAST_AIRSPEED = 1.0
DATA_STOPPED_US = 1_000_000


@kernel
def control_air_data_fusion(ekf, params):
    """Start, continue or stop airspeed, and give up the wind when nothing has observed it for 10 s."""
    aid = ekf.aid.airspeed
    airspeed_timed_out = is_timed_out(ekf, aid.time_last_fuse, WIND_TIMEOUT_US)
    sideslip_timed_out = is_timed_out(ekf, ekf.aid.sideslip.time_last_fuse, WIND_TIMEOUT_US)
    if ekf.cs.fake_pos or (airspeed_timed_out and sideslip_timed_out and not is_drag_enabled(ekf, params)):
        ekf.cs.wind = False
    if ekf.cs.wind and ekf.wind.external_init:
        ekf.wind.external_init = False

    _assume_yaw_estimator_airspeed(ekf, params)
    if params.EKF2_ARSP_THR <= 0.0:
        stop_airspeed_fusion(ekf)
    elif ekf.sensors.airspeed.data_ready:
        _take_airspeed_sample(ekf, params)
    elif ekf.cs.fuse_aspd and not is_recent(ekf, ekf.sensors.airspeed.sample.time_us, DATA_STOPPED_US):
        stop_airspeed_fusion(ekf)


@kernel
def _assume_yaw_estimator_airspeed(ekf, params):
    """While no airspeed is fused, the yaw estimator of a fixed wing compensates turns by an assumed one."""
    if ekf.cs.fixed_wing:
        if not ekf.cs.in_air or ekf.cs.vehicle_at_rest:
            set_true_airspeed(ekf.gsf, 0.0)
        elif not ekf.cs.fuse_aspd:
            set_true_airspeed(ekf.gsf, params.EKF2_GSF_TAS)


@kernel
def _use_airspeed_sample(ekf, params):
    aid, sample = ekf.aid.airspeed, ekf.sensors.airspeed.sample
    update_airspeed(ekf, params)
    ekf.reject.airspeed = aid.innovation_rejected
    continuing_conditions_passing = ekf.cs.in_air and not ekf.cs.fake_pos and _may_have_airspeed(ekf)
    is_significant = sample.true_airspeed > params.EKF2_ARSP_THR
    is_consistent = 0.0 < aid.test_ratio[0] < 1.0
    starting_conditions_passing = (
        continuing_conditions_passing
        and is_significant
        and (is_consistent or not ekf.cs.wind or _may_reset_velocity(ekf))
    )
    if ekf.cs.fuse_aspd:
        if not continuing_conditions_passing:
            stop_airspeed_fusion(ekf)
            return
        if is_significant:
            fuse_airspeed(ekf, params)
        set_true_airspeed(ekf.gsf, sample.true_airspeed)
        if is_timed_out(ekf, aid.time_last_fuse, WIND_TIMEOUT_US):
            stop_airspeed_fusion(ekf)
    elif starting_conditions_passing:
        _start_airspeed(ekf, params, is_consistent)
        ekf.cs.fuse_aspd = True


@kernel
def _judge_where_fused(ekf, params):
    """Judge the airspeed where it is fused, if the air is fast enough to have a direction."""
    aid, sample = ekf.aid.airspeed, ekf.sensors.airspeed.sample
    may_go_on = ekf.cs.in_air and ekf.cs.fixed_wing and not ekf.cs.fake_pos
    is_significant = sample.true_airspeed > params.EKF2_ARSP_THR
    if ekf.cs.fuse_aspd:
        if may_go_on and is_significant and predict_airspeed(ekf) >= LEAST_AIRSPEED:
            update_airspeed(ekf, params)
            ekf.reject.airspeed = aid.innovation_rejected
            fuse_airspeed(ekf, params)
        if not may_go_on or is_timed_out(ekf, aid.time_last_fuse, WIND_TIMEOUT_US):
            stop_airspeed_fusion(ekf)
    elif may_go_on and is_significant:
        if not ekf.cs.wind:
            ekf.cs.wind = True
            _reset_wind(ekf, params)
        ekf.cs.fuse_aspd = True


_take_airspeed_sample = by_release(_use_airspeed_sample, "judges_air_data_when_fused", _judge_where_fused)


@kernel
def _is_any_vehicle(ekf):
    return True


@kernel
def _is_fixed_wing(ekf):
    return ekf.cs.fixed_wing


_may_have_airspeed = by_release(
    by_release(_is_any_vehicle, "keeps_airspeed_to_wings", _is_fixed_wing), "asks_airspeed_for_wings", _is_fixed_wing
)


@kernel
def _where_lost(ekf):
    return ekf.cs.inertial_dead_reckoning


@kernel
def _never(ekf):
    return False


_may_reset_velocity = by_release(_where_lost, "starts_airspeed_by_wind", _never)


@kernel
def _reset_to_airspeed(ekf, params, is_consistent):
    """Set the velocity when dead reckoning, else an unknown wind."""
    largest = INITIAL_WIND_UNCERTAINTY * INITIAL_WIND_UNCERTAINTY
    wind_unknown = math.hypot(ekf.P[WIND, WIND], ekf.P[WIND + 1, WIND + 1]) > largest
    if ekf.cs.inertial_dead_reckoning and not is_consistent:
        reset_vel_using_airspeed(ekf, params)
    elif _is_wind_free(ekf, wind_unknown):
        _reset_wind(ekf, params)
    ekf.cs.wind = True


@kernel
def _reset_or_fuse_airspeed(ekf, params, is_consistent):
    """As v1.16's, but dead reckoning counts once it has lasted too long, and what needs no reset is fused."""
    largest = INITIAL_WIND_UNCERTAINTY * INITIAL_WIND_UNCERTAINTY
    wind_unknown = ekf.P[WIND, WIND] + ekf.P[WIND + 1, WIND + 1] > largest
    lost = ekf.cs.inertial_dead_reckoning and not is_consistent
    if ekf.horizontal_deadreckon_time_exceeded or lost:
        reset_vel_using_airspeed(ekf, params)
    elif _is_wind_free(ekf, wind_unknown):
        _reset_wind(ekf, params)
    else:
        fuse_airspeed(ekf, params)
    ekf.cs.wind = True


@kernel
def _reset_uncertain_wind(ekf, params, is_consistent):
    """Airspeed never sets the velocity; a wind that is not known, or not well, is set by it."""
    largest = INITIAL_WIND_UNCERTAINTY * INITIAL_WIND_UNCERTAINTY
    if not ekf.cs.wind or ekf.P[WIND, WIND] + ekf.P[WIND + 1, WIND + 1] > largest:
        ekf.cs.wind = True
        _reset_wind(ekf, params)


_start_airspeed = by_release(
    by_release(_reset_to_airspeed, "keeps_airspeed_to_wings", _reset_or_fuse_airspeed),
    "starts_airspeed_by_wind",
    _reset_uncertain_wind,
)


@kernel
def _is_wind_free(ekf, wind_unknown):
    return not ekf.wind.external_init and (not ekf.cs.wind or wind_unknown)


@kernel
def _reset_wind(ekf, params):
    reset_wind_using_airspeed(ekf, params)
    ekf.aid.airspeed.time_last_fuse = ekf.time_delayed_us


@kernel
def stop_airspeed_fusion(ekf):
    """Leave airspeed; the yaw estimator goes without."""
    if ekf.cs.fuse_aspd:
        ekf.cs.fuse_aspd = False
        forget_aid_source_status(ekf, ekf.aid.airspeed, 1)
        set_true_airspeed(ekf.gsf, np.nan)
