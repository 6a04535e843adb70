"""Hold the horizontal position where it was last known while nothing aids it.

`cs.valid_fake_pos`: the vehicle is at rest or said to be fixed, so the position is right. `cs.fake_pos`: it only
keeps the filter from diverging, while the tilt is uncertain and dead reckoning has lasted too long.

Mirrors PX4 v1.16 `EKF/aid_sources/fake_pos_control.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.conditions import IMU_CTRL_GRAVITY_VECTOR, is_horizontal_aiding_active
from fusetune.ekf2.filter.common.local_origin import offset_from_last_known, remember_horizontal_position
from fusetune.ekf2.filter.common.state import POSITION
from fusetune.ekf2.filter.common.timing import is_timed_out
from fusetune.ekf2.filter.covariance import tilt_variance
from fusetune.ekf2.filter.measurement_update import fuse_direct_state
from fusetune.ekf2.filter.resets.state_resets import (
    reset_horizontal_position_to_last_known,
    reset_horizontal_velocity_to_zero,
)
from fusetune.ekf2.releases.by_release import by_release

UPDATE_INTERVAL_US = 200_000
FAILURE_TIMEOUT_US = 400_000
INNOVATION_GATE = 3.0
SIGMA_AT_REST = 0.01
SIGMA_OTHERWISE = 0.5
TILT_UNCERTAIN_VARIANCE = math.radians(3.0) ** 2


@kernel
def control_fake_pos_fusion(ekf, params):
    """Fuse, start, reset or stop the fake position."""
    if is_horizontal_aiding_active(ekf):
        ekf.cs.fake_pos = False
        ekf.cs.valid_fake_pos = False
        return
    aid = ekf.aid.fake_pos
    if not is_timed_out(ekf, aid.time_last_fuse, UPDATE_INTERVAL_US):
        return
    _update_status(ekf, params, aid)
    enable_valid = ekf.cs.constant_pos or ekf.cs.vehicle_at_rest
    enable = (
        not enable_valid
        and tilt_variance(ekf) > TILT_UNCERTAIN_VARIANCE
        and not _is_gravity_leading(ekf, params)
        and ekf.horizontal_deadreckon_time_exceeded
    )
    ekf.cs.fake_pos = _run(ekf, params, enable, ekf.cs.fake_pos, aid)
    ekf.cs.valid_fake_pos = _run(ekf, params, enable_valid, ekf.cs.valid_fake_pos, aid)


@kernel
def _is_gravity_enabled(ekf, params):
    return (int(params.EKF2_IMU_CTRL) & IMU_CTRL_GRAVITY_VECTOR) != 0


@kernel
def _is_gravity_fused(ekf, params):
    return ekf.cs.gravity_vector


_is_gravity_leading = by_release(_is_gravity_enabled, "yields_to_gravity", _is_gravity_fused)


@kernel
def _update_status(ekf, params, aid):
    if ekf.cs.in_air and ekf.cs.tilt_align:
        sigma = max(params.EKF2_NOAID_NOISE, 1.0)
    elif not ekf.cs.in_air and ekf.cs.vehicle_at_rest:
        sigma = SIGMA_AT_REST
    else:
        sigma = SIGMA_OTHERWISE
    variance = sigma * sigma
    north, east = offset_from_last_known(ekf)
    set_axis(aid, 0, math.degrees(ekf.gpos_lat), variance, north, ekf.P[POSITION, POSITION] + variance)
    set_axis(aid, 1, math.degrees(ekf.gpos_lon), variance, east, ekf.P[POSITION + 1, POSITION + 1] + variance)
    update_aid_source_status(ekf, aid, 2, ekf.time_delayed_us, INNOVATION_GATE)


@kernel
def _run(ekf, params, enabled, active, aid):
    """One step of either kind of fake position; return whether it is active from now on."""
    if not enabled:
        return False
    if not active:
        reset_fake_pos_fusion(ekf, params)
        return True
    if not aid.innovation_rejected:
        for i in range(2):
            fuse_direct_state(
                ekf, params, aid.innovation[i], aid.innovation_variance[i], aid.observation_variance[i], POSITION + i
            )
        aid.fused = True
        aid.time_last_fuse = ekf.time_delayed_us
    if is_timed_out(ekf, aid.time_last_fuse, FAILURE_TIMEOUT_US):
        reset_fake_pos_fusion(ekf, params)
    return True


@kernel
def reset_fake_pos_fusion(ekf, params):
    """Take the present place as the known one, at rest."""
    remember_horizontal_position(ekf)
    reset_horizontal_position_to_last_known(ekf, params)
    reset_horizontal_velocity_to_zero(ekf, params)
    ekf.aid.fake_pos.time_last_fuse = ekf.time_delayed_us
