"""Fusion of all height sources, choice of the height reference, and health of the vertical acceleration.

Mirrors PX4 v1.16 `EKF/height_control.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.accel_bias_check import check_vertical_accel_bias
from fusetune.ekf2.filter.aid_sources.barometer.baro_height_control import control_baro_height_fusion
from fusetune.ekf2.filter.aid_sources.barometer.ground_effect import update_ground_effect
from fusetune.ekf2.filter.aid_sources.gnss.gnss_height_control import control_gnss_height_fusion
from fusetune.ekf2.filter.aid_sources.gnss.gnss_taken import take_gnss_sample
from fusetune.ekf2.filter.aid_sources.range_finder.range_control import control_range_fusion
from fusetune.ekf2.filter.common.height_reference import (
    HEIGHT_REF_BARO,
    HEIGHT_REF_EV,
    HEIGHT_REF_GNSS,
    HEIGHT_REF_RANGE,
    HEIGHT_REF_UNKNOWN,
)
from fusetune.ekf2.filter.common.timing import is_recent
from fusetune.ekf2.filter.one_height_source import control_one_height, replace_lost_height, watch_range_and_baro
from fusetune.ekf2.filter.yaw_estimator.told_velocity import run_told_matrix_bank
from fusetune.ekf2.numerics.constants import FLT_EPSILON
from fusetune.ekf2.releases.by_release import by_release

VERT_INNOV_TEST_LIM = 3.0
VERT_INNOV_TEST_MIN = 1.0
BADACC_PROBATION = 3_000_000
OLD_BADACC_PROBATION = 10_000_000
INNOVATION_AGE_US = 1_000_000

FALLING_UNLIKELY, FALLING_POSSIBLE, FALLING_LIKELY = 0, 1, 2


@kernel
def _control_heights(ekf, params):
    """Check the vertical acceleration, fuse every height source, and replace a lost height reference."""
    check_vertical_accel_bias(ekf, params)
    check_vertical_acceleration_health(ekf)
    update_ground_effect(ekf, params)
    control_baro_height_fusion(ekf, params)
    control_gnss_height_fusion(ekf, params)
    control_range_fusion(ekf, params)
    check_height_sensor_ref_fallback(ekf, params)


control_height_fusion = by_release(_control_heights, "has_one_height_source", control_one_height)
"""Fuse what gives the height."""


@kernel
def _watch_later(ekf, params):
    """Since v1.14 the height is watched where it is fused."""


@kernel
def _watch_before_fusion(ekf, params):
    watch_range_and_baro(ekf, params)
    take_gnss_sample(ekf, params)
    run_told_matrix_bank(ekf, params)
    check_vertical_acceleration_health(ekf)
    replace_lost_height(ekf, params)


watch_height_first = by_release(_watch_later, "has_one_height_source", _watch_before_fusion)
"""What of GNSS, height and yaw estimator comes before the magnetometer."""


@kernel
def check_height_sensor_ref_fallback(ekf, params):
    """Where there is no height reference, take the active source that comes first for EKF2_HGT_REF."""
    if ekf.height_sensor_ref != HEIGHT_REF_UNKNOWN:
        return
    wanted = int(params.EKF2_HGT_REF)
    if wanted == HEIGHT_REF_BARO:
        order = (HEIGHT_REF_BARO, HEIGHT_REF_GNSS, HEIGHT_REF_EV, HEIGHT_REF_RANGE)
    elif wanted == HEIGHT_REF_RANGE:
        order = (HEIGHT_REF_RANGE, HEIGHT_REF_EV, HEIGHT_REF_BARO, HEIGHT_REF_GNSS)
    elif wanted == HEIGHT_REF_EV:
        order = (HEIGHT_REF_EV, HEIGHT_REF_RANGE, HEIGHT_REF_BARO, HEIGHT_REF_GNSS)
    else:
        order = (HEIGHT_REF_GNSS, HEIGHT_REF_BARO, HEIGHT_REF_EV, HEIGHT_REF_RANGE)
    for source in order:
        if _is_height_source_active(ekf, source):
            ekf.height_sensor_ref = source
            return


@kernel
def _is_height_source_active(ekf, source):
    if source == HEIGHT_REF_BARO:
        return ekf.cs.baro_hgt
    if source == HEIGHT_REF_GNSS:
        return ekf.cs.gps_hgt
    if source == HEIGHT_REF_RANGE:
        return ekf.cs.rng_hgt
    return ekf.cs.ev_hgt


@kernel
def check_vertical_acceleration_health(ekf):
    """Detect accelerations that clipping or vibration bias towards free fall.

    Such a bias shows as vertical innovations that are all positive (prediction below the observation, in NED).
    `fs.bad_acc_vertical` persists for 3 s after the last detection, until v1.15 for 10 s.
    """
    falling = _falling_likelihood(ekf)
    is_clipping_frequently = _count_clipping(ekf)
    bad_vert_accel = falling == FALLING_LIKELY or (is_clipping_frequently and falling == FALLING_POSSIBLE)

    if bad_vert_accel:
        ekf.time_bad_vert_accel = ekf.time_delayed_us
    else:
        ekf.time_good_vert_accel = ekf.time_delayed_us
    if ekf.fs.bad_acc_vertical:
        ekf.fs.bad_acc_vertical = is_recent(ekf, ekf.time_bad_vert_accel, _bad_accel_probation(ekf))
    else:
        ekf.fs.bad_acc_vertical = bad_vert_accel


@kernel
def _count_clipping_of_axes(ekf):
    limit = int(1.0 / ekf.dt_ekf_avg)
    all_axes_warning = True
    any_axis_critical = False
    for axis in range(3):
        if ekf.imu_delayed.delta_vel_clipping[axis] and ekf.clip_counter[axis] < limit:
            ekf.clip_counter[axis] += 1
        elif ekf.clip_counter[axis] > 0:
            ekf.clip_counter[axis] -= 1
        all_axes_warning = all_axes_warning and ekf.clip_counter[axis] >= limit // 2
        any_axis_critical = any_axis_critical or ekf.clip_counter[axis] >= limit
    ekf.fs.bad_acc_clipping = all_axes_warning or any_axis_critical
    return ekf.fs.bad_acc_clipping or ekf.clip_counter[2] >= limit // 2


@kernel
def _count_clipping_of_any(ekf):
    """One counter, in the place of the first axis."""
    limit = int(1.0 / ekf.dt_ekf_avg)
    clipping, counter = ekf.imu_delayed.delta_vel_clipping, ekf.clip_counter
    if (clipping[0] or clipping[1] or clipping[2]) and counter[0] < limit:
        counter[0] += 1
    elif counter[0] > 0:
        counter[0] -= 1
    ekf.fs.bad_acc_clipping = counter[0] > limit // 2
    return counter[0] > 0


_count_clipping = by_release(_count_clipping_of_axes, "counts_clipping_of_any_axis", _count_clipping_of_any)
"""Count clipped samples up and clean ones down within a second's worth; return whether it is too frequent."""


@kernel
def _three_seconds(ekf):
    return BADACC_PROBATION


@kernel
def _ten_seconds(ekf):
    return OLD_BADACC_PROBATION


_bad_accel_probation = by_release(_three_seconds, "doubts_vertical_acceleration_for_10_s", _ten_seconds)


@kernel
def _normalised(is_active, innovation, innovation_variance):
    """Innovation over its standard deviation; 0 for a source that is not in use."""
    if not is_active or innovation_variance < FLT_EPSILON:
        return 0.0
    return innovation / math.sqrt(innovation_variance)


@kernel
def _is_far(innovation, innovation_variance):
    """Whether a normalised innovation may exceed 3: tells the usual case without a root."""
    return innovation > 0.0 and innovation * innovation > 8.9 * innovation_variance


@kernel
def _of_distance(ekf):
    return -ekf.aid.rng_hgt.innovation[0]


@kernel
def _of_height(ekf):
    return ekf.aid.rng_hgt.innovation[0]


_range_innovation = by_release(_of_distance, "takes_range_for_height", _of_height)
"""Innovation (m) of the height that range tells, positive where the estimate is below it."""


@kernel
def estimate_inertial_nav_falling_likelihood(ekf):
    """How likely the inertial navigation falls away from the height and vertical velocity observations.

    Possible if one source's normalised innovation exceeds 3, likely if another of a different kind (pressure, GNSS,
    ground) exceeds 1 as well. Range is measured towards the ground, so its innovation counts with opposite sign.
    """
    cs, aid = ekf.cs, ekf.aid
    knows_gnss = not ekf.sensors.gnss.withheld
    knows_baro = not ekf.sensors.baro.withheld
    if not (
        (cs.baro_hgt and knows_baro and _is_far(aid.baro_hgt.innovation[0], aid.baro_hgt.innovation_variance[0]))
        or (cs.gps_hgt and knows_gnss and _is_far(aid.gnss_hgt.innovation[0], aid.gnss_hgt.innovation_variance[0]))
        or (cs.gnss_vel and knows_gnss and _is_far(aid.gnss_vel.innovation[2], aid.gnss_vel.innovation_variance[2]))
        or cs.rng_hgt
        or cs.ev_hgt
        or cs.ev_vel
    ):
        return FALLING_UNLIKELY
    pressure = _normalised(cs.baro_hgt and knows_baro, aid.baro_hgt.innovation[0], aid.baro_hgt.innovation_variance[0])
    gnss = max(
        _normalised(cs.gps_hgt and knows_gnss, aid.gnss_hgt.innovation[0], aid.gnss_hgt.innovation_variance[0]),
        _normalised(cs.gnss_vel and knows_gnss, aid.gnss_vel.innovation[2], aid.gnss_vel.innovation_variance[2]),
    )
    ground = max(
        _normalised(cs.rng_hgt, _range_innovation(ekf), aid.rng_hgt.innovation_variance[0]),
        _normalised(cs.ev_hgt, aid.ev_hgt.innovation[0], aid.ev_hgt.innovation_variance[0]),
        _normalised(cs.ev_vel, aid.ev_vel.innovation[2], aid.ev_vel.innovation_variance[2]),
    )
    if not max(pressure, gnss, ground) > VERT_INNOV_TEST_LIM:
        return FALLING_UNLIKELY
    failed_min = int(pressure > VERT_INNOV_TEST_MIN) + int(gnss > VERT_INNOV_TEST_MIN)
    failed_min += int(ground > VERT_INNOV_TEST_MIN)
    return FALLING_LIKELY if failed_min > 1 else FALLING_POSSIBLE


@kernel
def _likelihood_by_last_innovations(ekf):
    """As v1.16's, of the last vertical position and velocity, whatever their sources.

    Both within 1 s must agree; it is likely where they are of two sensors.
    """
    vertical, cs = ekf.vertical, ekf.cs
    if not is_recent(ekf, vertical.position_us, INNOVATION_AGE_US):
        return FALLING_UNLIKELY
    if not is_recent(ekf, vertical.velocity_us, INNOVATION_AGE_US):
        return FALLING_POSSIBLE if vertical.position > VERT_INNOV_TEST_LIM else FALLING_UNLIKELY
    larger, smaller = max(vertical.position, vertical.velocity), min(vertical.position, vertical.velocity)
    if not (larger > VERT_INNOV_TEST_LIM and smaller > VERT_INNOV_TEST_MIN):
        return FALLING_UNLIKELY
    of_one_sensor = (cs.gps_hgt and cs.gnss_pos) or (cs.ev_hgt and cs.ev_vel)
    return FALLING_POSSIBLE if of_one_sensor else FALLING_LIKELY


_falling_likelihood = by_release(
    estimate_inertial_nav_falling_likelihood, "has_one_height_source", _likelihood_by_last_innovations
)
