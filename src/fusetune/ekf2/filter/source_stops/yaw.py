"""The yaw of GNSS, or of external vision, is fused no more."""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.aid_source_status import forget_aid_source_status
from fusetune.ekf2.releases.by_release import by_release


@kernel
def _stop(ekf):
    ekf.cs.gnss_yaw = False


@kernel
def _stop_and_lose_alignment(ekf):
    if ekf.cs.gnss_yaw:
        ekf.cs.gnss_yaw = False
        forget_aid_source_status(ekf, ekf.aid.gnss_yaw, 1)
        if not ekf.cs.in_air:
            ekf.cs.yaw_align = False


@kernel
def _stop_and_forget(ekf):
    if ekf.cs.gnss_yaw:
        ekf.cs.gnss_yaw = False
        forget_aid_source_status(ekf, ekf.aid.gnss_yaw, 1)


stop_gnss_yaw_fusion = by_release(
    by_release(_stop, "retries_gnss_yaw", _stop_and_lose_alignment), "checks_gnss_on_arrival", _stop_and_forget
)
"""Stop fusing the GNSS heading."""


@kernel
def stop_ev_yaw_fusion(ekf):
    """Leave external vision as yaw source."""
    if ekf.cs.ev_yaw:
        forget_aid_source_status(ekf, ekf.aid.ev_yaw, 1)
    ekf.cs.ev_yaw = False
