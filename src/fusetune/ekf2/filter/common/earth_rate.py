"""The rotation of the Earth (rad/s, NED), which the gyro measures along; zero until a latitude is known."""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.numerics.geodesy import earth_rate_ned
from fusetune.ekf2.releases.by_release import by_release

EARTH_RATE_LATITUDE_STEP = math.radians(1.0)


@kernel
def set_earth_rate(ekf, latitude):
    """Take the rotation at a latitude (rad)."""
    rate = ekf.earth_rate_ned
    rate[0], rate[1], rate[2] = earth_rate_ned(latitude)


@kernel
def _follow_latitude(ekf):
    if abs(ekf.gpos_lat - ekf.earth_rate_lat_ref) > EARTH_RATE_LATITUDE_STEP:
        ekf.earth_rate_lat_ref = ekf.gpos_lat
        set_earth_rate(ekf, ekf.gpos_lat)


@kernel
def _leave_to_magnetic_model(ekf):
    """It is set by what looks the magnetic model up."""


update_earth_rate = by_release(_follow_latitude, "flies_over_flat_earth", _leave_to_magnetic_model)
"""Look the rotation up once per degree of latitude of the estimate."""
