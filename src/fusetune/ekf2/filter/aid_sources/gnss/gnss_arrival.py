"""GNSS until v1.14: a sample is checked, and its position projected, as it arrives and not when it is due.

So it is judged by what the filter knows then, and a position that arrives before the origin is placed is zero for good.

Mirrors `setGpsData` and `collect_gps` of PX4 v1.14 `EKF/estimator_interface.cpp` and `EKF/gps_checks.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.feed.sensor_samples import GNSS_SAMPLE
from fusetune.ekf2.filter.aid_sources.gnss.gps_checks import clock_of_checks, run_gnss_checks
from fusetune.ekf2.filter.aid_sources.gnss.origin_by_checks import place_origin
from fusetune.ekf2.filter.common.earth_rate import set_earth_rate
from fusetune.ekf2.filter.common.field_parameters import MAG_TYPE_NONE
from fusetune.ekf2.filter.common.local_origin import project_to_local
from fusetune.ekf2.filter.world_field import look_field_up_by_fix
from fusetune.ekf2.releases.by_release import by_release

KEPT = 256
"""Places of the longest buffer."""

GNSS_ARRIVALS = np.dtype(
    [
        ("positions", "f8", (KEPT, 2)),
        ("sample", GNSS_SAMPLE),
        *fields("f8", "north", "east"),
        ("inhibits_ev_yaw", "?"),
    ],
    align=True,
)
"""Sub-record `ekf.gnss_arrivals`: where samples that wait were, north and east (m) of the origin; the one that arrives;
where the one was that is due; whether vision may not give the yaw since GNSS has started."""

DEGREE_PARTS = 1e7
MIN_FIX_TYPE = 3
TRUST_US = 5_000_000
"""How long no check may fail before GNSS is trusted, or none pass before it is not."""


@kernel
def _wait_until_due(ekf, params, sample, slot):
    """v1.15 looks at a sample when it is due."""


@kernel
def round_to_message(sample):
    """Give a sample the resolution of the message: 1e-7° and 1 mm, the latter in single precision."""
    sample.lat_deg = np.rint(sample.lat_deg * DEGREE_PARTS) / DEGREE_PARTS
    sample.lon_deg = np.rint(sample.lon_deg * DEGREE_PARTS) / DEGREE_PARTS
    sample.alt = float(np.float32(1e-3) * np.float32(np.rint(sample.alt * 1e3)))


@kernel
def _is_past(ekf, since_us, duration_us):
    """Whether it is longer ago than that since a check had a result."""
    return since_us == 0 or since_us + duration_us < clock_of_checks(ekf)


@kernel
def _check_and_project(ekf, params, given, slot):
    ekf.gnss_arrivals.sample = given
    sample = ekf.gnss_arrivals.sample
    round_to_message(sample)
    run_gnss_checks(ekf, params, sample)
    ekf.gnss.checks_passed = _is_past(ekf, ekf.gnss.last_fail_us, int(params.EKF2_REQ_GPS_H * 1e6))
    requested = ekf.mag_modes.yaw_reset_requested
    if not ekf.origin.valid:
        if ekf.filter_initialised and ekf.gnss.checks_passed:
            place_origin(ekf, sample)
            look_field_up_by_fix(ekf, sample, True)
            set_earth_rate(ekf, ekf.origin.lat_rad)
        elif look_field_up_by_fix(ekf, sample, True):
            set_earth_rate(ekf, math.radians(sample.lat_deg))
    if int(params.EKF2_MAG_TYPE) == MAG_TYPE_NONE:
        # no magnetometer could reset the yaw
        ekf.mag_modes.yaw_reset_requested = requested

    north, east = 0.0, 0.0
    if ekf.origin.valid and sample.fix_type >= MIN_FIX_TYPE:
        north, east = project_to_local(ekf, math.radians(sample.lat_deg), math.radians(sample.lon_deg))
    positions, place = ekf.gnss_arrivals.positions, slot % KEPT
    positions[place, 0], positions[place, 1] = north, east


look_at_arrived_gnss = by_release(_wait_until_due, "checks_gnss_on_arrival", _check_and_project)
"""What a sample, at a slot of its array, changes as it is buffered."""


@kernel
def _nothing_to_recall(ekf, slot):
    """v1.15 projects a sample when it is due."""


@kernel
def _recall_position(ekf, slot):
    sample = ekf.sensors.gnss.sample
    round_to_message(sample)
    if not math.isfinite(sample.yaw_offset):
        sample.yaw_offset = 0.0
    positions, place = ekf.gnss_arrivals.positions, slot % KEPT
    ekf.gnss_arrivals.north, ekf.gnss_arrivals.east = positions[place, 0], positions[place, 1]


recall_arrived_gnss = by_release(_nothing_to_recall, "checks_gnss_on_arrival", _recall_position)
"""The sample at a slot of its array is due."""


@kernel
def is_gnss_trusted(ekf):
    """Whether no check has failed for 5 s."""
    return _is_past(ekf, ekf.gnss.last_fail_us, TRUST_US)


@kernel
def is_gnss_distrusted(ekf):
    """Whether checks have failed for 5 s."""
    return _is_past(ekf, ekf.gnss.last_pass_us, TRUST_US)
