"""What the magnetometer aid source remembers between updates."""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.state import ERROR_STATE_SIZE

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

MAG_TYPE_AUTO, MAG_TYPE_HEADING, MAG_TYPE_NONE, MAG_TYPE_INIT = 0, 1, 5, 6

DECLINATION_FROM_WMM, DECLINATION_SAVED = 1, 2
"""Bits of EKF2_DECL_TYPE."""

CHECK_STRENGTH, CHECK_INCLINATION, CHECK_FORCE_WMM = 1, 2, 4
"""Bits of EKF2_MAG_CHECK."""


@kernel
def initialise_mag_memory(mag):
    """What is not zero at start: the world magnetic model is unknown until the origin is known."""
    mag.wmm_declination = np.nan
    mag.wmm_inclination = np.nan
    mag.wmm_strength = np.nan


@kernel
def clear_mag_faults(ekf):
    """No axis of the magnetometer is at fault."""
    ekf.fs.bad_mag_x = False
    ekf.fs.bad_mag_y = False
    ekf.fs.bad_mag_z = False
