"""Keep the earth field states near what is known of them: releases before v1.16 do after every fusion of the field.

Mirrors `limitDeclination` of PX4 v1.15 `EKF/mag_fusion.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.world_field import (
    get_mag_declination,
    has_saved_declination,
    has_wmm_declination,
)
from fusetune.ekf2.releases.by_release import by_release

DECLINATION_TOLERANCE = 0.5
HORIZONTAL_FIELD_MIN = 0.001
COLLAPSED_SHARE = 0.001


@kernel
def _limit_nothing(ekf, params):
    """v1.16 trusts the fusion."""


@kernel
def _model_or_saved(ekf, params):
    """Declination (rad) of the model or the saved one, as EKF2_DECL_TYPE wants; NaN if there is none."""
    if has_wmm_declination(ekf, params):
        return ekf.mag.wmm_declination
    return math.radians(params.EKF2_MAG_DECL) if has_saved_declination(params) else math.nan


@kernel
def _model_or_parameter(ekf, params):
    """As v1.15's; EKF2_MAG_DECL counts also where nothing was saved."""
    return ekf.mag.wmm_declination if has_wmm_declination(ekf, params) else math.radians(params.EKF2_MAG_DECL)


reference_declination = by_release(_model_or_saved, "fuses_heading_or_field", _model_or_parameter)
"""Declination (rad) that the one of the field states is compared with; NaN if there is none."""


@kernel
def _reference(ekf, params, reference):
    return reference


@kernel
def _assumed(ekf, params, reference):
    return get_mag_declination(ekf, params)


_declination_of_collapsed = by_release(_reference, "fuses_heading_or_field", _assumed)
"""Along which a horizontal field is put that has all but vanished."""


@kernel
def _limit_to_reference(ekf, params):
    """Horizontal field no less than half the model's, declination within 0.5 rad of the reference."""
    reference = reference_declination(ekf, params)
    if not math.isfinite(reference):
        return
    least = HORIZONTAL_FIELD_MIN
    if has_wmm_declination(ekf, params):
        least = max(least, 0.5 * ekf.mag.wmm_strength * math.cos(ekf.mag.wmm_inclination))
    horizontal = _widen_horizontal_field(ekf, least, _declination_of_collapsed(ekf, params, reference))
    declination = math.atan2(ekf.mag_I[1], ekf.mag_I[0])
    limited = min(max(declination, reference - DECLINATION_TOLERANCE), reference + DECLINATION_TOLERANCE)
    if limited != declination:
        ekf.mag_I[0] = horizontal * math.cos(limited)
        ekf.mag_I[1] = horizontal * math.sin(limited)


@kernel
def _widen_horizontal_field(ekf, least, declination):
    """Scale the horizontal field (Gauss) up to `least`; one that has collapsed is put along `declination` (rad).

    Returns
    -------
    float : strength with which a limited declination is to be set
    """
    field = ekf.mag_I
    horizontal = math.hypot(field[0], field[1])
    if horizontal >= least:
        return horizontal
    if horizontal > COLLAPSED_SHARE * least:
        field[0] *= least / horizontal
        field[1] *= least / horizontal
    else:
        field[0] = 2.0 * least * math.cos(declination)
        field[1] = 2.0 * least * math.sin(declination)
    return least


limit_field = by_release(_limit_nothing, "limits_declination", _limit_to_reference)
