"""The fake position of v1.15 and before: one kind, which is fused like any position.

Mirrors PX4 v1.15 and v1.14 `EKF/fake_pos_control.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.fake_position.fake_pos_control import (
    FAILURE_TIMEOUT_US,
    INNOVATION_GATE,
    SIGMA_AT_REST,
    SIGMA_OTHERWISE,
    TILT_UNCERTAIN_VARIANCE,
    UPDATE_INTERVAL_US,
    control_fake_pos_fusion,
    reset_fake_pos_fusion,
)
from fusetune.ekf2.filter.common.aid_source_status import forget_aid_source_status, set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.conditions import IMU_CTRL_GRAVITY_VECTOR, is_horizontal_aiding_active
from fusetune.ekf2.filter.common.local_origin import get_local_horizontal_position, offset_from_last_known
from fusetune.ekf2.filter.common.state import POSITION
from fusetune.ekf2.filter.common.timing import horizon_us, is_timed_out
from fusetune.ekf2.filter.covariance import tilt_variance
from fusetune.ekf2.filter.position_fusion import fuse_horizontal_position
from fusetune.ekf2.releases.by_release import by_release

EXTREME_TEST_RATIO = (100.0 / INNOVATION_GATE) ** 2


@kernel
def _control_one_kind(ekf, params):
    """Fuse, start, reset or stop the fake position."""
    aid = ekf.aid.fake_pos
    if is_horizontal_aiding_active(ekf):
        stop_fake_pos_fusion(ekf)
        return
    if not is_timed_out(ekf, aid.time_last_fuse, UPDATE_INTERVAL_US):
        return
    judge_last_known_position(ekf, params)
    if not _is_wanted(ekf, params):
        stop_fake_pos_fusion(ekf)
    elif ekf.cs.fake_pos:
        if aid.test_ratio[0] < EXTREME_TEST_RATIO and aid.test_ratio[1] < EXTREME_TEST_RATIO:
            fuse_horizontal_position(ekf, params, aid)
        if is_timed_out(ekf, aid.time_last_fuse, FAILURE_TIMEOUT_US):
            reset_fake_pos_fusion(ekf, params)
    elif ekf.horizontal_deadreckon_time_exceeded:
        ekf.cs.fake_pos = True
        reset_fake_pos_fusion(ekf, params)


@kernel
def _is_levelling_or_at_rest(ekf, params):
    """At rest, or while the tilt is uncertain and gravity does not lead it."""
    if ekf.cs.vehicle_at_rest:
        return True
    return tilt_variance(ekf) > TILT_UNCERTAIN_VARIANCE and int(params.EKF2_IMU_CTRL) & IMU_CTRL_GRAVITY_VECTOR == 0


@kernel
def _is_always_wanted(ekf, params):
    """v1.14 wants it whenever nothing aids."""
    return True


_is_wanted = by_release(_is_levelling_or_at_rest, "fakes_position_whenever_unaided", _is_always_wanted)


@kernel
def _least_sigma_in_air(ekf, params):
    return 1.0


@kernel
def _gnss_noise(ekf, params):
    return params.EKF2_GPS_P_NOISE


_least_sigma = by_release(_least_sigma_in_air, "fakes_position_whenever_unaided", _gnss_noise)


@kernel
def fake_position_variance(ekf, params):
    """Variance (m²) of each axis."""
    if ekf.cs.in_air and ekf.cs.tilt_align:
        sigma = max(params.EKF2_NOAID_NOISE, _least_sigma(ekf, params))
    elif not ekf.cs.in_air and ekf.cs.vehicle_at_rest:
        sigma = SIGMA_AT_REST
    else:
        sigma = SIGMA_OTHERWISE
    return sigma * sigma


@kernel
def judge_last_known_position(ekf, params):
    """Judge the last known position as an observation, north and east (m) of the origin."""
    aid, variance = ekf.aid.fake_pos, fake_position_variance(ekf, params)
    off_n, off_e = offset_from_last_known(ekf)
    at_n, at_e = get_local_horizontal_position(ekf)
    set_axis(aid, 0, at_n - off_n, variance, off_n, ekf.P[POSITION, POSITION] + variance)
    set_axis(aid, 1, at_e - off_e, variance, off_e, ekf.P[POSITION + 1, POSITION + 1] + variance)
    update_aid_source_status(ekf, aid, 2, horizon_us(ekf), INNOVATION_GATE)


@kernel
def stop_fake_pos_fusion(ekf):
    """Stop the fake position."""
    if ekf.cs.fake_pos:
        ekf.cs.fake_pos = False
        forget_aid_source_status(ekf, ekf.aid.fake_pos, 2)


@kernel
def _control_at_once(ekf, params):
    """As v1.14's, but every 0.2 s, from the first update on that nothing aids in, and judged where it is fused."""
    aid = ekf.aid.fake_pos
    if not is_timed_out(ekf, aid.time_last_fuse, UPDATE_INTERVAL_US):
        return
    if is_horizontal_aiding_active(ekf):
        ekf.cs.fake_pos = False
    elif not ekf.cs.fake_pos:
        ekf.cs.fake_pos = True
        reset_fake_pos_fusion(ekf, params)
    else:
        judge_last_known_position(ekf, params)
        aid.innovation_rejected = max(aid.test_ratio[0], aid.test_ratio[1]) > EXTREME_TEST_RATIO
        if fuse_horizontal_position(ekf, params, aid):
            ekf.reject.hor_pos = False
        if is_timed_out(ekf, aid.time_last_fuse, FAILURE_TIMEOUT_US):
            reset_fake_pos_fusion(ekf, params)


control_fake_position = by_release(
    by_release(control_fake_pos_fusion, "fakes_one_kind_of_position", _control_one_kind),
    "fakes_position_at_once",
    _control_at_once,
)
"""The fake position of the release at hand."""
