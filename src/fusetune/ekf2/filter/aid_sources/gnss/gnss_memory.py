"""What the GNSS aid source remembers between updates."""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel

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
        ("checks_passed", "?"),
        ("intermittent", "?"),
        ("last_fail_us", "i8"),
        ("last_pass_us", "i8"),
        ("prev_time_us", "i8"),
        ("prev_lat", "f8"),
        ("prev_lon", "f8"),
        ("prev_alt", "f8"),
        ("pos_deriv_filt", "f8", (3,)),
        ("vel_ne_filt", "f8", (2,)),
        ("vel_d_filt", "f8"),
        ("horizontal_position_drift_rate", "f8"),
        ("vertical_position_drift_rate", "f8"),
        ("filtered_horizontal_velocity", "f8"),
    ],
    align=True,
)
"""Sub-record `ekf.gnss`. `prev_…`: last fix (rad, m); `pos_deriv_filt` (NED), `vel_…_filt` and the three published
drift figures (m/s; NaN while not at rest on the ground) are low-passed with 10 s. `checks_passed` latches once the
checks have passed for EKF2_REQ_GPS_H.
"""

GPS_CTRL_HPOS, GPS_CTRL_VPOS, GPS_CTRL_VEL, GPS_CTRL_YAW = 1, 2, 4, 8
"""Bits of EKF2_GPS_CTRL."""


@kernel
def initialise_gnss_memory(gnss):
    """State before the first sample."""
    fail = gnss.fail
    fail.fix = False
    fail.nsats = False
    fail.pdop = False
    fail.hacc = False
    fail.vacc = False
    fail.sacc = False
    fail.hdrift = False
    fail.vdrift = False
    fail.hspeed = False
    fail.vspeed = False
    fail.spoofed = False
    gnss.checks_passed = False
    gnss.intermittent = True
    gnss.last_fail_us = 0
    gnss.last_pass_us = 0
    gnss.prev_time_us = 0
    gnss.prev_lat = 0.0
    gnss.prev_lon = 0.0
    gnss.prev_alt = np.nan
    gnss.horizontal_position_drift_rate = np.nan
    gnss.vertical_position_drift_rate = np.nan
    gnss.filtered_horizontal_velocity = np.nan
    gnss.pos_deriv_filt[:] = 0.0
    gnss.vel_ne_filt[:] = 0.0
    gnss.vel_d_filt = 0.0
