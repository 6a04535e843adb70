"""How far the last vertical position and velocity were off in v1.13, and whether they were fused.

Mirrors `fuseVerticalVelocity` and `fuseVerticalPosition` of PX4 v1.13 `EKF/vel_pos_fusion.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE_NAMES, set_axis
from fusetune.ekf2.filter.common.state import POSITION, VELOCITY
from fusetune.ekf2.filter.measurement_update import fuse_direct_state

VERTICAL_INNOVATIONS = np.dtype(
    [
        *fields("f8", "position", "velocity"),
        *fields("i8", "position_us", "velocity_us"),
        *fields("?", "gnss_rejected", "gnss_fused", "ev_rejected", "ev_fused"),
    ],
    align=True,
)
"""Sub-record `ekf.vertical`: the last innovations over their standard deviations, of whatever source, and when (µs);
what became of the vertical velocity of GNSS and of vision."""

GNSS_VELOCITY, VISION_VELOCITY = AID_SOURCE_NAMES.index("gnss_vel"), AID_SOURCE_NAMES.index("ev_vel")


@kernel
def fuse_vertical_velocity_apart(ekf, params, aid, gate, observation, variance, innovation, may_fuse):
    """Judge a vertical velocity (m/s) by itself and fuse it; return whether it was rejected, and whether fused.

    While the vertical acceleration is bad the innovation is limited to the gate, for the fusion alone.
    """
    index = VELOCITY + 2
    innovation_variance = ekf.P[index, index] + variance
    set_axis(aid, 2, observation, variance, innovation, innovation_variance)
    if not may_fuse:
        return not innovation * innovation <= gate * gate * innovation_variance, False
    ekf.vertical.velocity = innovation / math.sqrt(innovation_variance)
    ekf.vertical.velocity_us = ekf.time_delayed_us
    limited, passing = _limit(ekf, innovation, innovation_variance, gate)
    ekf.reject.ver_vel = not passing
    fused = passing and fuse_direct_state(ekf, params, limited, innovation_variance, variance, index)
    return not passing, fused


@kernel
def fuse_vertical_position_apart(ekf, params, aid, gate):
    """Fuse the height of an aid source of which a single axis was set; return whether it was fused."""
    innovation, variance = aid.innovation[0], aid.innovation_variance[0]
    ekf.vertical.position = innovation / math.sqrt(variance)
    ekf.vertical.position_us = ekf.time_delayed_us
    limited, passing = _limit(ekf, innovation, variance, gate)
    ekf.reject.ver_pos = not passing
    aid.innovation_rejected = not passing
    aid.fused = passing and fuse_direct_state(ekf, params, limited, variance, aid.observation_variance[0], POSITION + 2)
    if aid.fused:
        aid.time_last_fuse = ekf.time_delayed_us
    return aid.fused


@kernel
def _limit(ekf, innovation, variance, gate):
    """The innovation to fuse, and whether it may be."""
    limit = gate * math.sqrt(variance)
    if innovation * innovation <= limit * limit:
        return innovation, True
    if ekf.fs.bad_acc_vertical:
        return min(max(innovation, -limit), limit), True
    return innovation, False
