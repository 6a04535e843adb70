"""Fusion of NED velocity observations, axis by axis.

Mirrors PX4 v1.16 `EKF/velocity_fusion.cpp`, whose resets stand in `resets/`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.state import VELOCITY
from fusetune.ekf2.filter.measurement_update import fuse_direct_state


@kernel
def fuse_horizontal_velocity(ekf, params, aid):
    """Fuse north and east velocity of an aid source that has been judged; return whether it was fused."""
    aid.fused = _fuse_velocity_axes(ekf, params, aid, 2)
    if aid.fused:
        ekf.time_last_hor_vel_fuse = ekf.time_delayed_us
    return aid.fused


@kernel
def fuse_velocity(ekf, params, aid):
    """Fuse all three velocity axes of an aid source that has been judged; return whether they were fused."""
    aid.fused = _fuse_velocity_axes(ekf, params, aid, 3)
    if aid.fused:
        ekf.time_last_hor_vel_fuse = ekf.time_delayed_us
        ekf.time_last_ver_vel_fuse = ekf.time_delayed_us
    return aid.fused


@kernel
def _fuse_velocity_axes(ekf, params, aid, n_axes):
    if aid.innovation_rejected:
        return False
    for i in range(n_axes):
        fuse_direct_state(
            ekf, params, aid.innovation[i], aid.innovation_variance[i], aid.observation_variance[i], VELOCITY + i
        )
    aid.time_last_fuse = ekf.time_delayed_us
    return True


@kernel
def limit_vertical_innovation(aid, gate):
    """Limit the vertical innovation to the gate, and take the velocity as it is."""
    limit = gate * math.sqrt(aid.innovation_variance[2])
    aid.innovation[2] = min(max(aid.innovation[2], -limit), limit)
    aid.innovation_rejected = False
