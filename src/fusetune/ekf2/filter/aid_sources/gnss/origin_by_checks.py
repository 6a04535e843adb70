"""Where until v1.15 the first good GNSS sample places the origin, and rough fixes look up the magnetic field.

Mirrors `collect_gps` of PX4 v1.15 `EKF/gps_checks.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import is_horizontal_aiding_active
from fusetune.ekf2.filter.common.earth_rate import set_earth_rate
from fusetune.ekf2.filter.common.local_origin import (
    get_local_horizontal_position,
    reproject_to_global,
    set_origin_altitude,
    set_origin_lat_lon,
)
from fusetune.ekf2.filter.world_field import look_field_up_by_fix
from fusetune.ekf2.releases.by_release import by_release


@kernel
def _leave_to_resets(ekf, sample):
    """v1.16 places the origin when the position is first reset to GNSS, and looks the field up by the estimate."""


@kernel
def _place_origin_and_look_up(ekf, sample):
    if ekf.gnss.checks_passed and not ekf.origin.valid:
        place_origin(ekf, sample)
    if look_field_up_by_fix(ekf, sample, ekf.gnss.checks_passed or not ekf.origin.valid):
        set_earth_rate(ekf, math.radians(sample.lat_deg))


collect_gnss_sample = by_release(_leave_to_resets, "places_origin_by_checks", _place_origin_and_look_up)
"""Take from a sample that may be used what is not fused."""


@kernel
def place_origin(ekf, sample):
    """Place the origin at the sample, or where the filter began if it already navigates; its altitude likewise."""
    if not ekf.origin.lat_lon_valid:
        north, east = get_local_horizontal_position(ekf)
        set_origin_lat_lon(ekf, math.radians(sample.lat_deg), math.radians(sample.lon_deg))
        if is_horizontal_aiding_active(ekf):
            lat, lon = reproject_to_global(ekf, -north, -east)
            set_origin_lat_lon(ekf, lat, lon)
    if not math.isfinite(ekf.origin.alt):
        set_origin_altitude(ekf, sample.alt - ekf.gpos_alt)
    ekf.events.gps_checks_passed = True
