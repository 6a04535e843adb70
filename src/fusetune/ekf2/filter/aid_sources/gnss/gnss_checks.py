"""Is a GNSS fix good enough? Thresholds of EKF2_REQ_…, chosen by EKF2_GPS_CHECK, and drift while at rest."""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.timing import is_timed_out
from fusetune.ekf2.numerics.geodesy import project

DRIFT_TIME_CONSTANT_S = 10.0
MIN_DT_S = 0.001
DRIFT_LIMIT_FACTOR = 10.0
MIN_FIX_TYPE = 3
MIN_PASSING_TIME_US = 1_000_000

(
    CHECK_NSATS,
    CHECK_PDOP,
    CHECK_HACC,
    CHECK_VACC,
    CHECK_SACC,
    CHECK_HDRIFT,
    CHECK_VDRIFT,
    CHECK_HSPEED,
    CHECK_VSPEED,
    CHECK_SPOOFED,
) = (1 << bit for bit in range(10))


@kernel
def check_gnss_sample(ekf, params, sample):
    """Run the checks on a new sample; return whether it may be used.

    A sample is used once the checks have passed for a tenth of EKF2_REQ_GPS_H, and for 1 s at least. When they have
    passed for the whole of EKF2_REQ_GPS_H, `checks_passed` latches and GNSS fusion may start.
    """
    gnss = ekf.gnss
    required_us = int(params.EKF2_REQ_GPS_H * 1e6)
    if not run_gnss_checks(ekf, params, sample):
        return False
    if not is_timed_out(ekf, gnss.last_fail_us, max(MIN_PASSING_TIME_US, required_us // 10)):
        return False
    if is_timed_out(ekf, gnss.last_fail_us, required_us):
        if not gnss.checks_passed:
            ekf.events.gps_checks_passed = True
        gnss.checks_passed = True
    return True


@kernel
def run_gnss_checks(ekf, params, sample):
    """Judge one sample by the enabled checks and note the time of success or failure."""
    gnss = ekf.gnss
    _check_reported_quality(gnss.fail, params, sample)
    _check_drift(ekf, params, sample)
    _check_speed_limit(gnss.fail, params, sample)
    gnss.prev_lat = math.radians(sample.lat_deg)
    gnss.prev_lon = math.radians(sample.lon_deg)
    gnss.prev_alt = sample.alt
    gnss.prev_time_us = sample.time_us
    if gnss.last_fail_us == 0:
        gnss.last_fail_us = ekf.time_delayed_us
    if _any_enabled_check_fails(gnss.fail, int(params.EKF2_GPS_CHECK)):
        gnss.last_fail_us = ekf.time_delayed_us
        return False
    gnss.last_pass_us = ekf.time_delayed_us
    return True


@kernel
def _check_reported_quality(fail, params, sample):
    fail.spoofed = sample.spoofed
    fail.fix = sample.fix_type < MIN_FIX_TYPE
    fail.nsats = sample.nsats < int(params.EKF2_REQ_NSATS)
    fail.pdop = sample.pdop > params.EKF2_REQ_PDOP
    fail.hacc = sample.hacc > params.EKF2_REQ_EPH
    fail.vacc = sample.vacc > params.EKF2_REQ_EPV
    fail.sacc = sample.sacc > params.EKF2_REQ_SACC


@kernel
def _check_drift(ekf, params, sample):
    """Drift is known at rest on the ground only; it counts as passed in the air, and keeps its result in between."""
    gnss = ekf.gnss
    if not ekf.cs.in_air and ekf.cs.vehicle_at_rest:
        _filter_drift(gnss, params, sample)
        return
    if ekf.cs.in_air:
        gnss.fail.hdrift = False
        gnss.fail.vdrift = False
        gnss.fail.hspeed = False
        gnss.fail.vspeed = False
    _reset_drift_filters(gnss)


@kernel
def _filter_drift(gnss, params, sample):
    dt = min(max((sample.time_us - gnss.prev_time_us) * 1e-6, MIN_DT_S), DRIFT_TIME_CONSTANT_S)
    coefficient = dt / DRIFT_TIME_CONSTANT_S
    hdrift, vdrift = params.EKF2_REQ_HDRIFT, params.EKF2_REQ_VDRIFT
    h_limit, v_limit = DRIFT_LIMIT_FACTOR * hdrift, DRIFT_LIMIT_FACTOR * vdrift

    north, east, down = 0.0, 0.0, 0.0
    if gnss.prev_time_us > 0:
        north, east = project(gnss.prev_lat, gnss.prev_lon, math.radians(sample.lat_deg), math.radians(sample.lon_deg))
        down = gnss.prev_alt - sample.alt
    position = gnss.pos_deriv_filt
    position[0] = _low_pass(position[0], _limited(north / dt, h_limit), coefficient)
    position[1] = _low_pass(position[1], _limited(east / dt, h_limit), coefficient)
    position[2] = _low_pass(position[2], _limited(down / dt, v_limit), coefficient)
    gnss.horizontal_position_drift_rate = math.hypot(position[0], position[1])
    gnss.vertical_position_drift_rate = abs(position[2])

    velocity = gnss.vel_ne_filt
    velocity[0] = _low_pass(velocity[0], _limited(sample.vel[0], h_limit), coefficient)
    velocity[1] = _low_pass(velocity[1], _limited(sample.vel[1], h_limit), coefficient)
    gnss.filtered_horizontal_velocity = math.hypot(velocity[0], velocity[1])
    gnss.vel_d_filt = _low_pass(gnss.vel_d_filt, _limited(sample.vel[2], v_limit), coefficient)

    gnss.fail.hdrift = gnss.horizontal_position_drift_rate > hdrift
    gnss.fail.vdrift = gnss.vertical_position_drift_rate > vdrift
    gnss.fail.hspeed = gnss.filtered_horizontal_velocity > hdrift
    gnss.fail.vspeed = abs(gnss.vel_d_filt) > vdrift


@kernel
def _reset_drift_filters(gnss):
    gnss.vel_ne_filt[:] = 0.0
    gnss.vel_d_filt = 0.0
    gnss.pos_deriv_filt[:] = 0.0
    gnss.horizontal_position_drift_rate = np.nan
    gnss.vertical_position_drift_rate = np.nan
    gnss.filtered_horizontal_velocity = np.nan


@kernel
def _check_speed_limit(fail, params, sample):
    """No vehicle moves faster than EKF2_VEL_LIM."""
    if math.hypot(sample.vel[0], sample.vel[1]) > params.EKF2_VEL_LIM:
        fail.hspeed = True
    if abs(sample.vel[2]) > params.EKF2_VEL_LIM:
        fail.vspeed = True


@kernel
def _any_enabled_check_fails(fail, mask):
    return (
        fail.fix
        or (fail.nsats and mask & CHECK_NSATS != 0)
        or (fail.pdop and mask & CHECK_PDOP != 0)
        or (fail.hacc and mask & CHECK_HACC != 0)
        or (fail.vacc and mask & CHECK_VACC != 0)
        or (fail.sacc and mask & CHECK_SACC != 0)
        or (fail.hdrift and mask & CHECK_HDRIFT != 0)
        or (fail.vdrift and mask & CHECK_VDRIFT != 0)
        or (fail.hspeed and mask & CHECK_HSPEED != 0)
        or (fail.vspeed and mask & CHECK_VSPEED != 0)
        or (fail.spoofed and mask & CHECK_SPOOFED != 0)
    )


@kernel
def _low_pass(state, value, coefficient):
    return value * coefficient + state * (1.0 - coefficient)


@kernel
def _limited(value, limit):
    return min(max(value, -limit), limit)
