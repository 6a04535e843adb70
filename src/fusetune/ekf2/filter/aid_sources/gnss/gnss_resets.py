"""Whether GNSS may reset what it aids, or start without a reset (since v1.17).

Mirrors `isGnssVelResetAllowed` and its like of PX4 v1.17 `EKF/aid_sources/gnss/gps_control.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import is_other_source_of_horizontal_aiding_than
from fusetune.ekf2.releases.by_release import by_release

GPS_MODE_DEAD_RECKONING = 1
"""EKF2_GPS_MODE: GNSS yields to every other source."""

CLOSE_TEST_RATIO = 0.25
"""Sum of the ratios of north and east up to which a start needs no reset."""


@kernel
def is_gnss_reset_allowed(ekf, params, aided_otherwise, is_active):
    """Whether a state may be reset to GNSS.

    Parameters
    ----------
    aided_otherwise : whether another source aids that very state
    is_active : whether GNSS aids it now
    """
    if ekf.gnss_trust.fault:
        return False
    if int(params.EKF2_GPS_MODE) == GPS_MODE_DEAD_RECKONING:
        return not is_other_source_of_horizontal_aiding_than(ekf, is_active)
    return not aided_otherwise


@kernel
def may_start_without_reset(ekf, aid, force_reset):
    """Whether the sample in hand is so close that it can simply be fused, with a yaw that is not new."""
    if force_reset or not ekf.cs_prev.yaw_align:
        return False
    return _is_close(ekf, aid)


@kernel
def _is_sum_small(ekf, aid):
    return aid.test_ratio[0] + aid.test_ratio[1] < CLOSE_TEST_RATIO


@kernel
def _is_each_within_gate(ekf, aid):
    return aid.test_ratio[0] < 1.0 and aid.test_ratio[1] < 1.0


_is_close = by_release(_is_sum_small, "starts_gnss_within_gates", _is_each_within_gate)
