"""Is a GNSS fix good enough? Thresholds of EKF2_REQ_…, chosen by EKF2_GPS_CHECK, and drift while at rest.

Mirrors PX4 v1.16 `EKF/aid_sources/gnss/gps_checks.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.gnss.gnss_memory import forget_drift
from fusetune.ekf2.filter.common.timing import is_timed_out
from fusetune.ekf2.numerics.geodesy import project
from fusetune.ekf2.releases.by_release import by_release

DRIFT_TIME_CONSTANT_S = 10.0
MIN_DT_S = 0.001
DRIFT_LIMIT_FACTOR = 10.0
MIN_FIX_TYPE = 3
WORST_POSITION_ACCURACY, WORST_SPEED_ACCURACY = 50.0, 10.0
"""Limits (m, m/s) of the simplified checks."""

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
    CHECK_FIX,
) = (1 << bit for bit in range(11))


@kernel
def _check_gnss_sample(ekf, params, sample):
    """Run the checks on a new sample; return whether it may be used.

    A sample is used once the checks have passed for a tenth of EKF2_REQ_GPS_H, and for 1 s at least. When they have
    passed for the whole of EKF2_REQ_GPS_H, `checks_passed` latches and GNSS fusion may start.
    """
    gnss = ekf.gnss
    required_us = int(params.EKF2_REQ_GPS_H * 1e6)
    if not run_gnss_checks(ekf, params, sample):
        return False
    if not is_timed_out(ekf, gnss.last_fail_us, _passing_time_us(ekf, required_us)):
        return False
    if is_timed_out(ekf, gnss.last_fail_us, required_us):
        if not gnss.checks_passed:
            ekf.events.gps_checks_passed = True
        gnss.checks_passed = True
    return True


@kernel
def _tenth_or_second(ekf, required_us):
    return max(MIN_PASSING_TIME_US, required_us // 10)


@kernel
def _half(ekf, required_us):
    return required_us // 2


_passing_time_us = by_release(_tenth_or_second, "waits_half_health_time", _half)
"""How long the checks must have passed before a sample is used."""


@kernel
def _check_gnss_sample_simply(ekf, params, sample):
    """Run the checks on a new sample; return whether it may be used.

    Those of the start until they have passed for EKF2_REQ_GPS_H, then simplified ones for good; a sample is used while
    these have passed for a tenth of that, and for 1 s at least. Starting asks for the result of the latest sample.
    """
    gnss, passed = ekf.gnss, False
    required_us = int(params.EKF2_REQ_GPS_H * 1e6)
    if gnss.last_fail_us == 0:
        gnss.last_fail_us = ekf.time_delayed_us
    _forget_on_ground(ekf)
    if gnss.checks_passed:
        sound = not _is_unusable(gnss.fail, params, sample)
        passed = sound and is_timed_out(ekf, gnss.last_fail_us, max(MIN_PASSING_TIME_US, required_us // 10))
    else:
        sound = not _is_unfit_to_start(ekf, params, sample)
        passed = sound and is_timed_out(ekf, gnss.last_fail_us, required_us)
        if passed:
            gnss.checks_passed = True
            ekf.events.gps_checks_passed = True
    if sound:
        gnss.last_pass_us = ekf.time_delayed_us
    else:
        gnss.last_fail_us = ekf.time_delayed_us
    _remember_fix(gnss, sample, sample.time_us)
    ekf.gnss_trust.passed = passed
    return passed


@kernel
def _forget_nothing(ekf):
    """v1.17 keeps to the simplified checks for good."""


@kernel
def _forget_that_checks_passed(ekf):
    if not ekf.cs.in_air:
        ekf.gnss.checks_passed = False


_forget_on_ground = by_release(_forget_nothing, "checks_gnss_strictly_on_ground", _forget_that_checks_passed)


@kernel
def _is_unusable(fail, params, sample):
    """Whether an enabled one of the simplified checks fails."""
    mask = int(params.EKF2_GPS_CHECK)
    fail.fix = sample.fix_type < MIN_FIX_TYPE
    fail.hacc = sample.hacc > WORST_POSITION_ACCURACY
    fail.vacc = sample.vacc > WORST_POSITION_ACCURACY
    fail.sacc = sample.sacc > WORST_SPEED_ACCURACY
    fail.spoofed = sample.spoofed
    return (
        (fail.fix and mask & CHECK_FIX != 0)
        or (fail.hacc and mask & CHECK_HACC != 0)
        or (fail.vacc and mask & CHECK_VACC != 0)
        or (fail.sacc and mask & CHECK_SACC != 0)
        or (fail.spoofed and mask & CHECK_SPOOFED != 0)
    )


@kernel
def _is_unfit_to_start(ekf, params, sample):
    """Whether an enabled one of the checks of the start fails; the fix is compared with EKF2_REQ_FIX."""
    fail, mask = ekf.gnss.fail, int(params.EKF2_GPS_CHECK)
    _check_reported_quality(fail, params, sample)
    fail.fix = sample.fix_type < int(params.EKF2_REQ_FIX) and mask & CHECK_FIX != 0
    _check_drift(ekf, params, sample)
    _check_speed_limit(fail, params, sample)
    return _any_enabled_check_fails(fail, mask)


check_gnss_sample = by_release(_check_gnss_sample, "simplifies_gnss_checks", _check_gnss_sample_simply)


@kernel
def _now_at_horizon(ekf):
    return ekf.time_delayed_us


@kernel
def _now_at_newest(ekf):
    return ekf.time_latest_us


clock_of_checks = by_release(_now_at_horizon, "aids_gnss_by_mask", _now_at_newest)
"""The time (µs) that results of checks are noted at, and compared with."""


@kernel
def _time_of_sample(ekf, sample):
    return sample.time_us


@kernel
def _time_of_newest(ekf, sample):
    return ekf.time_latest_us


_time_of_fix = by_release(_time_of_sample, "aids_gnss_by_mask", _time_of_newest)
"""The time (µs) of a fix, as its drift is told of it."""


@kernel
def run_gnss_checks(ekf, params, sample):
    """Judge one sample by the enabled checks and note the time of success or failure."""
    gnss, now = ekf.gnss, clock_of_checks(ekf)
    _check_reported_quality(gnss.fail, params, sample)
    _check_motion(ekf, params, sample)
    _remember_fix(gnss, sample, _time_of_fix(ekf, sample))
    if gnss.last_fail_us == 0:
        gnss.last_fail_us = now
    if _any_enabled_check_fails(gnss.fail, int(params.EKF2_GPS_CHECK)):
        gnss.last_fail_us = now
        return False
    gnss.last_pass_us = now
    return True


@kernel
def _remember_fix(gnss, sample, time_us):
    gnss.prev_lat = math.radians(sample.lat_deg)
    gnss.prev_lon = math.radians(sample.lon_deg)
    gnss.prev_alt = sample.alt
    gnss.prev_time_us = time_us


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
        _filter_drift(gnss, params, sample, _interval(gnss, _time_of_fix(ekf, sample)))
        return
    if ekf.cs.in_air:
        gnss.fail.hdrift = False
        gnss.fail.vdrift = False
        gnss.fail.hspeed = False
        gnss.fail.vspeed = False
    forget_drift(gnss)


@kernel
def _interval(gnss, time_us):
    """Time (s) since the last fix."""
    return min(max((time_us - gnss.prev_time_us) * 1e-6, MIN_DT_S), DRIFT_TIME_CONSTANT_S)


@kernel
def _filter_drift(gnss, params, sample, dt):
    coefficient = dt / DRIFT_TIME_CONSTANT_S
    hdrift, vdrift = params.EKF2_REQ_HDRIFT, params.EKF2_REQ_VDRIFT
    h_limit, v_limit = DRIFT_LIMIT_FACTOR * hdrift, DRIFT_LIMIT_FACTOR * vdrift

    north, east, down = 0.0, 0.0, 0.0
    if gnss.prev_time_us > 0:
        north, east = project(gnss.prev_lat, gnss.prev_lon, math.radians(sample.lat_deg), math.radians(sample.lon_deg))
        down = gnss.prev_alt - sample.alt
    position = gnss.pos_deriv_filt
    position[0] = _filtered_drift(params, position[0], north / dt, h_limit, coefficient)
    position[1] = _filtered_drift(params, position[1], east / dt, h_limit, coefficient)
    position[2] = _filtered_drift(params, position[2], down / dt, v_limit, coefficient)
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
def _check_speed_limit(fail, params, sample):
    """No vehicle moves faster than EKF2_VEL_LIM."""
    if math.hypot(sample.vel[0], sample.vel[1]) > params.EKF2_VEL_LIM:
        fail.hspeed = True
    if abs(sample.vel[2]) > params.EKF2_VEL_LIM:
        fail.vspeed = True


@kernel
def _check_drift_and_limit(ekf, params, sample):
    _check_drift(ekf, params, sample)
    _check_speed_limit(ekf.gnss.fail, params, sample)


@kernel
def _check_drift_and_climb(ekf, params, sample):
    """Drift as v1.16; the vertical speed is compared with the filter's, whether or not the vehicle moves."""
    gnss = ekf.gnss
    gnss.fail.spoofed = False
    coefficient = _interval(gnss, _time_of_fix(ekf, sample)) / DRIFT_TIME_CONSTANT_S
    limit = DRIFT_LIMIT_FACTOR * params.EKF2_REQ_VDRIFT
    difference = _low_pass(gnss.vel_d_filt, _limited(sample.vel[2] - ekf.vel[2], limit), coefficient)
    _check_drift(ekf, params, sample)
    gnss.vel_d_filt = difference
    gnss.fail.vspeed = abs(difference) > params.EKF2_REQ_VDRIFT


_check_motion = by_release(_check_drift_and_limit, "compares_gnss_climb", _check_drift_and_climb)


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
def _filtered_limited_drift(params, state, drift, limit, coefficient):
    return _low_pass(state, _limited(drift, limit), coefficient)


@kernel
def _limited_filtered_drift(params, state, drift, limit, coefficient):
    """Limiting what is filtered, not what goes in, leaves no bias where jumps go one way at once and back slowly."""
    return _limited(_low_pass(state, drift, coefficient), limit)


_filtered_drift = by_release(_filtered_limited_drift, "simplifies_gnss_checks", _limited_filtered_drift)


@kernel
def _low_pass(state, value, coefficient):
    return value * coefficient + state * (1.0 - coefficient)


@kernel
def _limited(value, limit):
    return min(max(value, -limit), limit)
