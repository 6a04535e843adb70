"""Setting the origin of the local frame, and resets of the position that may have to set it first.

Latitudes and longitudes are radians, altitudes metres; a variance of NaN leaves the covariance as it is. The
functions return False, and do nothing, when the place is not on the globe.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import is_local_horizontal_position_valid, is_local_vertical_position_valid
from fusetune.ekf2.filter.common.local_origin import (
    get_local_horizontal_position,
    is_altitude_plausible,
    is_lat_lon_plausible,
    reproject_to_global,
    set_origin_altitude,
    set_origin_lat_lon,
)
from fusetune.ekf2.filter.common.state import POSITION
from fusetune.ekf2.filter.covariance import reset_covariance_block
from fusetune.ekf2.filter.output_predictor import apply_position_reset
from fusetune.ekf2.filter.resets.state_resets import (
    MIN_RESET_VARIANCE,
    reset_altitude_to,
    reset_horizontal_position_to,
    shift_external_vision_position_bias,
    update_horizontal_position_reset_status,
    update_terrain_reset_status,
    update_vertical_position_reset_status,
)
from fusetune.ekf2.numerics.geodesy import lat_lon_difference


@kernel
def reset_lat_lon_to(ekf, params, lat, lon, hpos_var):
    """Set the horizontal position; where no origin is known yet, place it.

    If the filter has been navigating from an unknown starting point, the origin becomes that starting point.
    """
    if not is_lat_lon_plausible(lat, lon):
        return False
    before_n, before_e = get_local_horizontal_position(ekf)
    if not ekf.origin.lat_lon_valid:
        set_origin_lat_lon(ekf, lat, lon)
        if is_local_horizontal_position_valid(ekf):
            start_lat, start_lon = reproject_to_global(ekf, -before_n, -before_e)
            set_origin_lat_lon(ekf, start_lat, start_lon)

    step = lat_lon_difference(lat, lon, ekf.gpos_alt, ekf.gpos_lat, ekf.gpos_lon)
    ekf.gpos_lat, ekf.gpos_lon = lat, lon
    apply_position_reset(ekf, step[0], step[1], 0.0)
    after_n, after_e = get_local_horizontal_position(ekf)
    delta_n, delta_e = after_n - before_n, after_e - before_e
    shift_external_vision_position_bias(ekf, delta_n, delta_e)
    update_horizontal_position_reset_status(ekf, delta_n, delta_e)
    if math.isfinite(hpos_var):
        reset_covariance_block(ekf, POSITION, 2, max(MIN_RESET_VARIANCE, hpos_var))
    ekf.time_last_hor_pos_fuse = ekf.time_delayed_us
    return True


@kernel
def initialise_altitude_to(ekf, params, altitude, vpos_var):
    """Set the altitude; where the origin has none yet, give it one that keeps the local height if that is valid."""
    if not is_altitude_plausible(altitude):
        return False
    if not math.isfinite(ekf.origin.alt):
        if is_local_vertical_position_valid(ekf):
            set_origin_altitude(ekf, altitude - ekf.gpos_alt)
        else:
            set_origin_altitude(ekf, altitude)
    reset_altitude_to(ekf, params, altitude, vpos_var)
    return True


@kernel
def reset_global_position_to(ekf, params, lat, lon, altitude, hpos_var, vpos_var):
    """Set the whole position, the altitude only if it is plausible."""
    if not reset_lat_lon_to(ekf, params, lat, lon, hpos_var):
        return False
    initialise_altitude_to(ekf, params, altitude, vpos_var)
    return True


@kernel
def set_lat_lon_origin(ekf, params, lat, lon, hpos_var):
    """Move the origin; a position known in the local frame alone becomes a global one."""
    if not is_lat_lon_plausible(lat, lon):
        return False
    local_n, local_e = get_local_horizontal_position(ekf)
    navigating_locally = not ekf.origin.lat_lon_valid and is_local_horizontal_position_valid(ekf)
    set_origin_lat_lon(ekf, lat, lon)
    if navigating_locally:
        new_lat, new_lon = reproject_to_global(ekf, local_n, local_e)
        reset_horizontal_position_to(ekf, params, new_lat, new_lon, hpos_var, hpos_var)
    else:
        new_n, new_e = get_local_horizontal_position(ekf)
        update_horizontal_position_reset_status(ekf, new_n - local_n, new_e - local_e)
    return True


@kernel
def set_alt_origin(ekf, params, altitude, vpos_var):
    """Move the origin's altitude; a height known in the local frame alone becomes a global one."""
    if not is_altitude_plausible(altitude):
        return False
    if not math.isfinite(ekf.origin.alt) and is_local_vertical_position_valid(ekf):
        local_alt = ekf.gpos_alt
        set_origin_altitude(ekf, altitude)
        reset_altitude_to(ekf, params, local_alt + altitude, math.nan)
    else:
        step_up = altitude - ekf.origin.alt
        set_origin_altitude(ekf, altitude)
        update_vertical_position_reset_status(ekf, -step_up)
        update_terrain_reset_status(ekf, -step_up)
    return True


@kernel
def set_ekf_global_origin(ekf, params, lat, lon, altitude, hpos_var, vpos_var):
    """Move the origin, its altitude only if it is plausible (the `SET_GPS_GLOBAL_ORIGIN` command)."""
    if not set_lat_lon_origin(ekf, params, lat, lon, hpos_var):
        return False
    set_alt_origin(ekf, params, altitude, vpos_var)
    return True
