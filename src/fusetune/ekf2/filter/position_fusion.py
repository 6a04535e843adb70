"""Fusion of position observations: horizontal (NE, m) and vertical (down, m)."""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.state import POSITION
from fusetune.ekf2.filter.measurement_update import fuse_direct_state


@kernel
def update_vertical_position_aid_status(ekf, aid, time_us, observation, observation_variance, innovation_gate):
    """Judge a vertical position observation (m, down).

    While the vertical acceleration is bad the innovation is limited to the gate rather than rejected, since the
    observation is what can still hold the height.
    """
    set_axis(
        aid,
        0,
        observation,
        observation_variance,
        -ekf.gpos_alt - observation,
        ekf.P[POSITION + 2, POSITION + 2] + observation_variance,
    )
    update_aid_source_status(ekf, aid, 1, time_us, innovation_gate)
    if ekf.fs.bad_acc_vertical and aid.innovation_rejected:
        limit = innovation_gate * math.sqrt(aid.innovation_variance[0])
        aid.innovation[0] = min(max(aid.innovation[0], -limit), limit)
        aid.innovation_rejected = False


@kernel
def fuse_horizontal_position(ekf, params, aid):
    """Fuse north and east position of an aid source that has been judged; return whether they were fused."""
    aid.fused = not aid.innovation_rejected
    if aid.fused:
        for i in range(2):
            fuse_direct_state(
                ekf, params, aid.innovation[i], aid.innovation_variance[i], aid.observation_variance[i], POSITION + i
            )
        aid.time_last_fuse = ekf.time_delayed_us
        ekf.time_last_hor_pos_fuse = ekf.time_delayed_us
    return aid.fused


@kernel
def fuse_vertical_position(ekf, params, aid):
    """Fuse the vertical position of an aid source that has been judged; return whether it was fused."""
    aid.fused = not aid.innovation_rejected
    if aid.fused:
        fuse_direct_state(
            ekf, params, aid.innovation[0], aid.innovation_variance[0], aid.observation_variance[0], POSITION + 2
        )
        aid.time_last_fuse = ekf.time_delayed_us
        ekf.time_last_hgt_fuse = ekf.time_delayed_us
    return aid.fused
