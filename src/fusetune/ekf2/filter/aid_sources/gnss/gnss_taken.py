"""GNSS of v1.13: the sample that was due last, moved to the IMU once and for all, for whatever is fused or reset by it.

Mirrors `controlFusionModes` of PX4 v1.13 `EKF/control.cpp`, as far as it takes GNSS, and `getGpsHeightVariance` of
`EKF/ekf_helper.cpp`.
"""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.filter.aid_sources.gnss.antenna_offset import antenna_offset_body
from fusetune.ekf2.filter.aid_sources.gnss.gnss_velocity import velocity_of_antenna_offset
from fusetune.ekf2.filter.common.local_origin import origin_altitude
from fusetune.ekf2.filter.common.timing import GNSS_MAX_INTERVAL, is_newest_sample_recent
from fusetune.ekf2.numerics.rotations import rotate_to_earth

GNSS_TAKEN = np.dtype(
    [
        ("vel", "f8", (3,)),
        *fields("f8", "north", "east", "altitude", "sacc", "hacc", "vacc"),
        *fields("i8", "time_us", "time_before_us", "yaw_time_us", "yaw_reset_us", "yaw_resets"),
    ],
    align=True,
)
"""Sub-record `ekf.gnss_taken`: velocity (m/s, NED), place (m from the origin) and altitude (m) of the IMU by the last
sample, its accuracies (m/s, m, m), its time and that of the one before (µs); when one told a heading, and when and how
often the yaw was reset to the yaw estimator's."""

VERTICAL_TO_HORIZONTAL = 1.5
LEAST_NOISE = 0.01


@kernel
def take_gnss_sample(ekf, params):
    """Keep a sample that is due, as one of the IMU."""
    gnss, taken = ekf.sensors.gnss, ekf.gnss_taken
    ekf.gnss.intermittent = not is_newest_sample_recent(ekf, gnss.newest_time_us, 2 * GNSS_MAX_INTERVAL)
    taken.time_before_us = taken.time_us
    if not gnss.data_ready:
        return
    sample = gnss.sample
    offset_n, offset_e, offset_d = velocity_of_antenna_offset(ekf, params)
    taken.vel[0] = sample.vel[0] - offset_n
    taken.vel[1] = sample.vel[1] - offset_e
    taken.vel[2] = sample.vel[2] - offset_d
    x, y, z = antenna_offset_body(params)
    offset_n, offset_e, offset_d = rotate_to_earth(ekf.R_to_earth, x, y, z)
    taken.north = ekf.gnss_arrivals.north - offset_n
    taken.east = ekf.gnss_arrivals.east - offset_e
    taken.altitude = sample.alt + offset_d
    taken.sacc = max(sample.sacc, params.EKF2_GPS_V_NOISE)
    taken.hacc, taken.vacc = sample.hacc, sample.vacc
    taken.time_us = sample.time_us


@kernel
def gnss_height(ekf):
    """Height (m) above the origin by the last sample."""
    return ekf.gnss_taken.altitude - origin_altitude(ekf)


@kernel
def gnss_height_variance(ekf, params):
    """Variance (m²) of that, within limits."""
    least = max(VERTICAL_TO_HORIZONTAL * params.EKF2_GPS_P_NOISE, LEAST_NOISE)
    most = max(VERTICAL_TO_HORIZONTAL * params.EKF2_NOAID_NOISE, least)
    deviation = min(max(ekf.gnss_taken.vacc, least), most)
    return deviation * deviation
