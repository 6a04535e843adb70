"""Auxiliary horizontal velocity, from a precision landing target that does not move.

It supports other horizontal aiding and is not fused without. Mirrors PX4 v1.16
`EKF/aid_sources/auxvel/auxvel_fusion.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.conditions import is_horizontal_aiding_active
from fusetune.ekf2.filter.common.state import VELOCITY
from fusetune.ekf2.filter.velocity_fusion import fuse_horizontal_velocity

AUXVEL_GATE = 5.0


@kernel
def control_aux_vel_fusion(ekf, params):
    """Judge the auxiliary velocity due now, and fuse it beside another horizontal aid."""
    if not ekf.auxvel_data_ready:
        return
    aid, sample = ekf.aid.aux_vel, ekf.auxvel_sample
    for i in range(2):
        variance = sample.vel_var[i]
        innovation_variance = ekf.P[VELOCITY + i, VELOCITY + i] + variance
        set_axis(aid, i, sample.vel[i], variance, ekf.vel[i] - sample.vel[i], innovation_variance)
    update_aid_source_status(ekf, aid, 2, sample.time_us, AUXVEL_GATE)
    if is_horizontal_aiding_active(ekf):
        fuse_horizontal_velocity(ekf, params, aid)
