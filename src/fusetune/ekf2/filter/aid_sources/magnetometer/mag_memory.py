"""What the magnetometer aid source remembers between updates."""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.filter.common.aid_source_status import AID_SOURCE
from fusetune.ekf2.filter.common.state import ERROR_STATE_SIZE
from fusetune.ekf2.releases.by_release import by_release

MAG_MEMORY = np.dtype(
    [
        ("lpf", "f8", (3,)),
        ("counter", "i8"),
        ("heading_innovation_lpf", "f8"),
        ("strength", "f8"),
        ("inclination", "f8"),
        ("time_last_check_failing", "i8"),
        ("flt_mag_align_start_time", "i8"),
        ("wmm_declination", "f8"),
        ("wmm_inclination", "f8"),
        ("wmm_strength", "f8"),
        ("wmm_earth_field", "f8", (3,)),
        ("wmm_time_last_checked", "i8"),
        ("declination_saved", "?"),
        ("jacobians", "f8", (3, ERROR_STATE_SIZE)),
    ],
    align=True,
)
"""Sub-record `ekf.mag`: filtered field (Gauss), field checks, and the world magnetic model at the last look-up.

Angles are rad, strength and field Gauss (field in NED), times µs. `jacobians` is work space of the fusion.
"""

FIELD_HISTORY = np.dtype(
    [
        ("wmm_time_last_set", "i8"),
        ("declination_fused", "?"),
        ("yaw_observable", "?"),
        ("resets_available", "i8"),
    ],
    align=True,
)
"""Sub-record `ekf.field_history` of releases before v1.16: when the known field of the model was last replaced (µs);
whether the declination was fused since the field's covariance was reset; whether the vehicle accelerates enough to tell
the heading; and how often a fusion that fails may still reset the field.
"""

MAG_MODES = np.dtype(
    [
        *fields("?", "yaw_reset_requested", "bias_observable", "inhibited", "inhibited_for_long", "other_yaw_before"),
        *fields("i8", "time_last_suitable", "time_last_used", "time_turn_started", "bad_yaw_events"),
        *fields("f8", "turn", "turn_rate_lpf", "saved_down_variance", "static_yaw"),
        ("saved_body_variance", "f8", (3,)),
        *fields("f8", "newest_turn", "newest_down", shape=(3,)),
        ("newest_dt", "f8"),
        ("saved_horizontal_covariance", "f8", (2, 2)),
        ("held_yaw", AID_SOURCE),
    ],
    align=True,
)
"""Sub-record `ekf.mag_modes` of releases before v1.15, which fuse either the heading or the field.

Whether the yaw is to be reset; whether the vehicle turns enough to tell the body field, and when it last moved enough
to tell it or the heading (µs); when the magnetometer was last used (µs), and whether it may not be used, or could not
for long; whether the yaw came from elsewhere; the turn about down since `time_turn_started` (rad) and its filtered rate
(rad/s), in v1.13 without the newest IMU sample, whose turn (rad, body), interval (s) and direction of down (body) wait
for the next; variances of the field states while they are not estimated; the yaw at which the vehicle came to rest
(rad, NaN if it did not), and what becomes of fusing that.
"""


CHECK_STRENGTH, CHECK_INCLINATION, CHECK_FORCE_WMM = 1, 2, 4
"""Bits of EKF2_MAG_CHECK."""


@kernel
def initialise_mag_memory(mag):
    """What is not zero at start: the world magnetic model is unknown until the origin is known."""
    mag.wmm_declination = np.nan
    mag.wmm_inclination = np.nan
    mag.wmm_strength = np.nan


@kernel
def _have_no_modes(ekf):
    """Since v1.15 there are none."""


@kernel
def _never_came_to_rest(ekf):
    ekf.mag_modes.static_yaw = np.nan


initialise_mag_modes = by_release(_have_no_modes, "fuses_heading_or_field", _never_came_to_rest)
"""What of `ekf.mag_modes` is not zero at start."""
