"""Hold the height where it was last known while nothing aids height or vertical velocity.

Mirrors PX4 v1.16 `EKF/aid_sources/fake_height_control.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.aid_source_status import forget_aid_source_status
from fusetune.ekf2.filter.common.conditions import is_vertical_aiding_active
from fusetune.ekf2.filter.common.state import POSITION
from fusetune.ekf2.filter.common.timing import is_timed_out
from fusetune.ekf2.filter.measurement_update import fuse_direct_state
from fusetune.ekf2.filter.position_fusion import update_vertical_position_aid_status
from fusetune.ekf2.filter.resets.state_resets import reset_height_to_last_known, reset_vertical_velocity_to_zero

UPDATE_INTERVAL_US = 200_000
FAILURE_TIMEOUT_US = 400_000
INNOVATION_GATE = 3.0
EXTREME_TEST_RATIO = (100.0 / INNOVATION_GATE) ** 2


@kernel
def control_fake_hgt_fusion(ekf, params):
    """Fuse, start, reset or stop the fake height."""
    if is_vertical_aiding_active(ekf):
        if ekf.cs.fake_hgt:
            ekf.cs.fake_hgt = False
            forget_aid_source_status(ekf, ekf.aid.fake_hgt, 1)
        return
    aid = ekf.aid.fake_hgt
    if not is_timed_out(ekf, aid.time_last_fuse, UPDATE_INTERVAL_US):
        return
    variance = params.EKF2_NOAID_NOISE**2
    update_vertical_position_aid_status(ekf, aid, ekf.time_delayed_us, -ekf.last_known_alt, variance, INNOVATION_GATE)
    if ekf.cs.fake_hgt:
        _fuse(ekf, params, aid)
    elif ekf.vertical_velocity_deadreckon_time_exceeded and ekf.vertical_position_deadreckon_time_exceeded:
        ekf.cs.fake_hgt = True
        _reset_fake_hgt_fusion(ekf, params)


@kernel
def _fuse(ekf, params, aid):
    if aid.test_ratio[0] < EXTREME_TEST_RATIO and not aid.innovation_rejected:
        fuse_direct_state(
            ekf, params, aid.innovation[0], aid.innovation_variance[0], aid.observation_variance[0], POSITION + 2
        )
        aid.fused = True
        aid.time_last_fuse = ekf.time_delayed_us
    if is_timed_out(ekf, aid.time_last_fuse, FAILURE_TIMEOUT_US):
        _reset_fake_hgt_fusion(ekf, params)


@kernel
def _reset_fake_hgt_fusion(ekf, params):
    """Take the present height as the known one, at rest."""
    ekf.last_known_alt = ekf.gpos_alt
    reset_vertical_velocity_to_zero(ekf, params)
    reset_height_to_last_known(ekf, params)
    ekf.aid.fake_hgt.time_last_fuse = ekf.time_delayed_us
