"""External vision of v1.13 as the one source of height, where EKF2_HGT_MODE asks for it: as it is, without a bias.

Mirrors `fuseEvHgt` of PX4 v1.13 `EKF/height_fusion.cpp` and `resetHeightToEv` of `EKF/ekf_helper.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.timing import EV_MAX_INTERVAL, is_newest_sample_recent
from fusetune.ekf2.filter.position_fusion import fuse_vertical_position, update_vertical_position_aid_status
from fusetune.ekf2.filter.resets.state_resets import reset_altitude_to

LEAST_VARIANCE = 0.01**2


@kernel
def has_recent_vision(ekf):
    """Whether samples still come."""
    return is_newest_sample_recent(ekf, ekf.sensors.ev.newest_time_us, 2 * EV_MAX_INTERVAL)


@kernel
def fuse_vision_height(ekf, params):
    """Judge the down position of the sample due now, and fuse it."""
    sample, aid = ekf.sensors.ev.sample, ekf.aid.ev_hgt
    variance = max(sample.position_var[2], LEAST_VARIANCE)
    update_vertical_position_aid_status(
        ekf, aid, sample.time_us, sample.pos[2], variance, max(params.EKF2_EVP_GATE, 1.0)
    )
    fuse_vertical_position(ekf, params, aid)


@kernel
def reset_height_to_vision(ekf, params):
    """Take the height from the newest sample that was due."""
    sample = ekf.sensors.ev.sample
    ekf.events.reset_hgt_to_ev = True
    reset_altitude_to(ekf, params, -sample.pos[2], max(sample.position_var[2], LEAST_VARIANCE))
