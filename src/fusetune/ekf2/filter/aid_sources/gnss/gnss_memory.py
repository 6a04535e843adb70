"""What the GNSS aid source remembers between updates."""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.releases.by_release import by_release

GNSS_CHECK_NAMES = (
    "fix",
    "nsats",
    "pdop",
    "hacc",
    "vacc",
    "sacc",
    "hdrift",
    "vdrift",
    "hspeed",
    "vspeed",
    "spoofed",
)
"""Quality checks; all but the fix are enabled by the bits of EKF2_GPS_CHECK, in this order from `nsats` on."""

GNSS_CHECK_FAILURES = np.dtype([(name, "?") for name in GNSS_CHECK_NAMES])

GNSS_MEMORY = np.dtype(
    [
        ("fail", GNSS_CHECK_FAILURES),
        *fields("?", "checks_passed", "intermittent"),
        *fields("i8", "last_fail_us", "last_pass_us", "prev_time_us"),
        *fields("f8", "prev_lat", "prev_lon", "prev_alt"),
        ("pos_deriv_filt", "f8", (3,)),
        ("vel_ne_filt", "f8", (2,)),
        ("vel_d_filt", "f8"),
        *fields("f8", "horizontal_position_drift_rate", "vertical_position_drift_rate", "filtered_horizontal_velocity"),
    ],
    align=True,
)
"""Sub-record `ekf.gnss`. `prev_…`: last fix (rad, m); `pos_deriv_filt` (NED), `vel_…_filt` and the three published
drift figures (m/s; NaN while not at rest on the ground) are low-passed with 10 s. `checks_passed` latches once the
checks have passed for EKF2_REQ_GPS_H.
"""

GNSS_TRUST = np.dtype([*fields("?", "passed", "fault", "height_fault"), ("height_rejected_us", "i8")], align=True)
"""Sub-record `ekf.gnss_trust`, since v1.17: whether the latest sample passed the checks, whether position and velocity,
or the height, count as faulty, and when the height was last rejected (µs)."""

GNSS_YAW_RETRIES = np.dtype([("resets_left", "i8"), ("signed_test_ratio_lpf", "f8")], align=True)
"""Sub-record `ekf.gnss_yaw_retries`, until v1.15: how often a heading that fails may still reset the yaw in flight, and
its low-passed test ratio with the sign of the innovation."""

GPS_CTRL_HPOS, GPS_CTRL_VPOS, GPS_CTRL_VEL, GPS_CTRL_YAW = 1, 2, 4, 8
"""Bits of EKF2_GPS_CTRL."""


@kernel
def initialise_gnss_memory(gnss):
    """What is not zero at start: no sample has come, and no drift is known."""
    gnss.intermittent = True
    gnss.prev_alt = np.nan
    forget_drift(gnss)


@kernel
def forget_drift(gnss):
    """Start the filters of the drift at rest anew."""
    gnss.vel_ne_filt[:] = 0.0
    gnss.vel_d_filt = 0.0
    gnss.pos_deriv_filt[:] = 0.0
    gnss.horizontal_position_drift_rate = np.nan
    gnss.vertical_position_drift_rate = np.nan
    gnss.filtered_horizontal_velocity = np.nan


@kernel
def _forget_checks(ekf):
    """Let the quality checks start anew."""
    ekf.gnss.last_fail_us = 0
    ekf.gnss.last_pass_us = 0


@kernel
def _forget_checks_and_result(ekf):
    _forget_checks(ekf)
    ekf.gnss_trust.passed = False


@kernel
def _keep_checks(ekf):
    """v1.14 checks whatever arrives, whether or not it is used."""


forget_checks = by_release(
    by_release(_forget_checks, "simplifies_gnss_checks", _forget_checks_and_result),
    "checks_gnss_on_arrival",
    _keep_checks,
)


@kernel
def _latched_result(ekf):
    """Whether the checks have passed at some time."""
    return ekf.gnss.checks_passed


@kernel
def _latest_result(ekf):
    """Whether the latest sample passed the checks."""
    return ekf.gnss_trust.passed


have_checks_passed = by_release(_latched_result, "simplifies_gnss_checks", _latest_result)
"""Whether GNSS may be started."""
