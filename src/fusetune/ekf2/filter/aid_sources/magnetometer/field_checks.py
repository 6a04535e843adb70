"""Is the measured field the Earth's? Strength and inclination against the world magnetic model.

Mirrors `checkMagField` of PX4 v1.16 `EKF/aid_sources/magnetometer/mag_control.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_memory import CHECK_FORCE_WMM, CHECK_INCLINATION, CHECK_STRENGTH
from fusetune.ekf2.filter.common.conditions import is_north_east_aiding_active
from fusetune.ekf2.filter.common.field_parameters import MAG_TYPE_3D, MAG_TYPE_INDOOR
from fusetune.ekf2.numerics.rotations import component_in_earth, wrap_pi

AVERAGE_STRENGTH = 0.45
AVERAGE_STRENGTH_TOLERANCE = 0.40
MODEL_STRENGTH_TOLERANCE = 0.2
MIN_HEALTH_TIME = 1_000_000
NORM_FLOOR = 1e-4


@kernel
def is_measured_matching_expected(measured, expected, gate):
    """Whether `measured` lies within `gate` of `expected`."""
    return expected - gate <= measured <= expected + gate


@kernel
def is_strength_wrong(ekf, params):
    """Strength outside EKF2_MAG_CHK_STR of the model or, where there is none, outside what the Earth has anywhere."""
    if np.isfinite(ekf.mag.wmm_strength):
        return not is_measured_matching_expected(ekf.mag.strength, ekf.mag.wmm_strength, params.EKF2_MAG_CHK_STR)
    return not is_measured_matching_expected(ekf.mag.strength, AVERAGE_STRENGTH, AVERAGE_STRENGTH_TOLERANCE)


@kernel
def is_strength_disturbed(ekf, params, field):
    """Whether a field (3,) is off the model's strength by more than 0.2 Gauss, or beyond what the Earth has anywhere.

    Mirrors `magFieldStrengthDisturbed` of PX4 v1.14 `EKF/mag_control.cpp`.
    """
    mag_type = int(params.EKF2_MAG_TYPE)
    is_asked = mag_type <= MAG_TYPE_3D or (mag_type == MAG_TYPE_INDOOR and is_north_east_aiding_active(ekf))
    if int(params.EKF2_MAG_CHECK) == 0 or not is_asked:
        return False
    strength = math.sqrt(field[0] ** 2 + field[1] ** 2 + field[2] ** 2)
    if np.isfinite(ekf.mag.wmm_strength):
        return not is_measured_matching_expected(strength, ekf.mag.wmm_strength, MODEL_STRENGTH_TOLERANCE)
    return not is_measured_matching_expected(strength, AVERAGE_STRENGTH, AVERAGE_STRENGTH_TOLERANCE)


@kernel
def check_mag_field(ekf, params, mag_sample):
    """Run the checks of EKF2_MAG_CHECK; True once none failed for more than 1 s.

    Sets `ekf.cs.mag_field_disturbed`. Requiring the model (bit 2) while it is unknown fails without a disturbance.
    """
    ekf.cs.mag_field_disturbed = False
    checks = int(params.EKF2_MAG_CHECK)
    if checks == 0:
        return True

    mag = ekf.mag
    wmm_required = (checks & CHECK_FORCE_WMM) != 0
    is_failing = False
    mag.strength = math.sqrt(mag_sample[0] ** 2 + mag_sample[1] ** 2 + mag_sample[2] ** 2)
    if (checks & CHECK_STRENGTH) != 0:
        if wmm_required and not np.isfinite(mag.wmm_strength):
            is_failing = True
        elif is_strength_wrong(ekf, params):
            ekf.cs.mag_field_disturbed = True
            is_failing = True

    down = component_in_earth(ekf.R_to_earth, 2, mag_sample[0], mag_sample[1], mag_sample[2])
    mag.inclination = math.asin(min(max(down / max(mag.strength, NORM_FLOOR), -1.0), 1.0))
    if (checks & CHECK_INCLINATION) != 0:
        if np.isfinite(mag.wmm_inclination):
            if abs(wrap_pi(mag.inclination - mag.wmm_inclination)) > math.radians(params.EKF2_MAG_CHK_INC):
                ekf.cs.mag_field_disturbed = True
                is_failing = True
        elif wmm_required:
            is_failing = True

    if is_failing or mag.time_last_check_failing == 0:
        mag.time_last_check_failing = ekf.time_delayed_us
    return ekf.time_delayed_us - mag.time_last_check_failing > MIN_HEALTH_TIME
