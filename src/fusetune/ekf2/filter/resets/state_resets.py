"""Resets of velocity, position, height and yaw, with the counters and changes that are published.

Each reset sets the state, uncorrelates it at the given variance (a variance of NaN leaves the covariance alone),
moves the output predictor along, and records the change. Resets within one update add up.

Mirrors the resets of PX4 v1.16 `EKF/position_fusion.cpp`, `EKF/velocity_fusion.cpp` and `EKF/yaw_fusion.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import is_north_east_aiding_active
from fusetune.ekf2.filter.common.global_position import single_precision
from fusetune.ekf2.filter.common.local_origin import project_to_local, reproject_to_global
from fusetune.ekf2.filter.common.state import ATTITUDE, POSITION, VELOCITY
from fusetune.ekf2.filter.covariance import reset_covariance_block, uncorrelate_block
from fusetune.ekf2.filter.output_predictor.output_predictor import (
    apply_position_reset,
    apply_quaternion_reset,
    apply_velocity_reset,
)
from fusetune.ekf2.filter.quaternion_core.quaternion_covariance import add_yaw_variance, uncorrelate_quaternion
from fusetune.ekf2.numerics.constants import FLT_EPSILON
from fusetune.ekf2.numerics.rotations import (
    dcm_to_quat,
    euler_yaw,
    quat_multiply,
    quat_multiply_inverse,
    quat_normalise,
    quat_to_dcm,
    update_yaw_in_rot_mat,
    wrap_pi,
)
from fusetune.ekf2.releases.by_release import by_release

MIN_RESET_VARIANCE = 0.01**2
LEAST_TURN_OF_VELOCITY = 0.3
HORIZONTAL_VELOCITY_VARIANCE_AFTER_ZEROING = 25.0
VERTICAL_VELOCITY_VARIANCE_AFTER_ZEROING = 10.0


@kernel
def remember_reset_counters(ekf):
    """Note the counters at the start of an update, so that its resets are told from earlier ones."""
    now, before = ekf.state_reset, ekf.state_reset_prev
    before.vel_ne_counter = now.vel_ne_counter
    before.vel_d_counter = now.vel_d_counter
    before.pos_ne_counter = now.pos_ne_counter
    before.pos_d_counter = now.pos_d_counter
    before.quat_counter = now.quat_counter
    before.hagl_counter = now.hagl_counter


@kernel
def _next(counter):
    """Published counters are eight bits wide."""
    return (counter + 1) % 256


@kernel
def _added_up(change, delta, counter, counter_before):
    """Sum of a state's changes since the counter was `counter_before`, at the start of this update."""
    return (0.0 if counter == counter_before else change) + delta


@kernel
def _reset_variance(ekf, index, variance):
    if math.isfinite(variance):
        reset_covariance_block(ekf, index, 1, max(MIN_RESET_VARIANCE, variance))


@kernel
def _reset_one_after_the_other(ekf, var_n, var_e):
    _reset_variance(ekf, VELOCITY, var_n)
    _reset_variance(ekf, VELOCITY + 1, var_e)


@kernel
def _reset_at_once(ekf, var_n, var_e):
    """Both axes in one, where one is known: the other then keeps its variance, but no covariance."""
    if math.isfinite(var_n) or math.isfinite(var_e):
        north = max(MIN_RESET_VARIANCE, var_n) if math.isfinite(var_n) else ekf.P[VELOCITY, VELOCITY]
        east = max(MIN_RESET_VARIANCE, var_e) if math.isfinite(var_e) else ekf.P[VELOCITY + 1, VELOCITY + 1]
        reset_covariance_block(ekf, VELOCITY, 1, north)
        reset_covariance_block(ekf, VELOCITY + 1, 1, east)


_reset_horizontal_velocity_variances = by_release(
    _reset_one_after_the_other, "resets_horizontal_velocity_at_once", _reset_at_once
)


@kernel
def _uncorrelate_each(ekf, index, dof):
    for i in range(index, index + dof):
        uncorrelate_block(ekf, i, 1)


@kernel
def _keep_correlated(ekf, index, dof):
    """Until v1.15 the position keeps what it has in common with other states."""


_uncorrelate_position = by_release(_uncorrelate_each, "keeps_position_at_velocity_resets", _keep_correlated)


@kernel
def reset_horizontal_velocity_to(ekf, params, vn, ve, var_n, var_e):
    """Set north and east velocity (m/s) and their variances; horizontal position is uncorrelated."""
    delta_n, delta_e = vn - ekf.vel[0], ve - ekf.vel[1]
    ekf.vel[0], ekf.vel[1] = vn, ve
    _reset_horizontal_velocity_variances(ekf, var_n, var_e)
    _uncorrelate_position(ekf, POSITION, 2)
    apply_velocity_reset(ekf, delta_n, delta_e, 0.0)
    reset = ekf.state_reset
    before = ekf.state_reset_prev.vel_ne_counter
    reset.vel_ne_change[0] = _added_up(reset.vel_ne_change[0], delta_n, reset.vel_ne_counter, before)
    reset.vel_ne_change[1] = _added_up(reset.vel_ne_change[1], delta_e, reset.vel_ne_counter, before)
    reset.vel_ne_counter = _next(reset.vel_ne_counter)
    ekf.time_last_hor_vel_fuse = ekf.time_delayed_us


@kernel
def reset_vertical_velocity_to(ekf, params, vd, var):
    """Set down velocity (m/s) and its variance; vertical position is uncorrelated."""
    delta = vd - ekf.vel[2]
    ekf.vel[2] = vd
    _reset_variance(ekf, VELOCITY + 2, var)
    _uncorrelate_position(ekf, POSITION + 2, 1)
    apply_velocity_reset(ekf, 0.0, 0.0, delta)
    reset = ekf.state_reset
    before = ekf.state_reset_prev.vel_d_counter
    reset.vel_d_change = _added_up(reset.vel_d_change, delta, reset.vel_d_counter, before)
    reset.vel_d_counter = _next(reset.vel_d_counter)
    ekf.time_last_ver_vel_fuse = ekf.time_delayed_us


@kernel
def reset_velocity_to(ekf, params, vel, var):
    """Set the velocity (NED, m/s) and its variances, both arrays of three."""
    reset_horizontal_velocity_to(ekf, params, vel[0], vel[1], var[0], var[1])
    reset_vertical_velocity_to(ekf, params, vel[2], var[2])


@kernel
def reset_horizontal_velocity_to_zero(ekf, params):
    """Nothing is known of the horizontal velocity: start from rest."""
    ekf.events.reset_vel_to_zero = True
    variance = HORIZONTAL_VELOCITY_VARIANCE_AFTER_ZEROING
    reset_horizontal_velocity_to(ekf, params, 0.0, 0.0, variance, variance)


@kernel
def reset_vertical_velocity_to_zero(ekf, params):
    """Nothing is known of the vertical velocity: start from rest, with room to converge."""
    reset_vertical_velocity_to(ekf, params, 0.0, VERTICAL_VELOCITY_VARIANCE_AFTER_ZEROING)


@kernel
def update_horizontal_position_reset_status(ekf, delta_n, delta_e):
    """Record a jump (m) of the local horizontal position."""
    reset = ekf.state_reset
    before = ekf.state_reset_prev.pos_ne_counter
    reset.pos_ne_change[0] = _added_up(reset.pos_ne_change[0], delta_n, reset.pos_ne_counter, before)
    reset.pos_ne_change[1] = _added_up(reset.pos_ne_change[1], delta_e, reset.pos_ne_counter, before)
    reset.pos_ne_counter = _next(reset.pos_ne_counter)


@kernel
def update_vertical_position_reset_status(ekf, delta_d):
    """Record a jump (m, down) of the height."""
    reset = ekf.state_reset
    before = ekf.state_reset_prev.pos_d_counter
    reset.pos_d_change = _added_up(reset.pos_d_change, delta_d, reset.pos_d_counter, before)
    reset.pos_d_counter = _next(reset.pos_d_counter)


@kernel
def update_terrain_reset_status(ekf, delta_d):
    """Record a jump (m, down) of the terrain height."""
    reset = ekf.state_reset
    before = ekf.state_reset_prev.hagl_counter
    reset.hagl_change = _added_up(reset.hagl_change, delta_d, reset.hagl_counter, before)
    reset.hagl_counter = _next(reset.hagl_counter)


@kernel
def shift_external_vision_position_bias(ekf, delta_n, delta_e):
    """Keep the external vision position where it was relative to the vehicle's new position."""
    if _is_bias_shifted(ekf, ekf.cs.ev_pos):
        bias = ekf.ev_pos_b_est
        bias.north.bias -= delta_n
        bias.east.bias -= delta_e


@kernel
def _is_always_shifted(ekf, active):
    return True


@kernel
def _is_active(ekf, active):
    return active


_is_bias_shifted = by_release(_is_always_shifted, "shifts_active_biases", _is_active)
"""Whether the bias of a source moves along with the state that is reset."""


@kernel
def _reset_lat_lon(ekf, params, lat_rad, lon_rad, var_n, var_e):
    before_n, before_e = project_to_local(ekf, ekf.gpos_lat, ekf.gpos_lon)
    after_n, after_e = project_to_local(ekf, lat_rad, lon_rad)
    delta_n, delta_e = after_n - before_n, after_e - before_e
    update_horizontal_position_reset_status(ekf, delta_n, delta_e)
    shift_external_vision_position_bias(ekf, delta_n, delta_e)
    ekf.gpos_lat, ekf.gpos_lon = lat_rad, lon_rad
    apply_position_reset(ekf, delta_n, delta_e, 0.0)
    _reset_variance(ekf, POSITION, var_n)
    _reset_variance(ekf, POSITION + 1, var_e)
    ekf.time_last_hor_pos_fuse = ekf.time_delayed_us


@kernel
def _reset_north_east(ekf, params, north, east, var_n, var_e):
    north, east = single_precision(north), single_precision(east)
    delta_n, delta_e = north - ekf.local.north, east - ekf.local.east
    ekf.local.north, ekf.local.east = north, east
    _reset_variance(ekf, POSITION, var_n)
    _reset_variance(ekf, POSITION + 1, var_e)
    apply_position_reset(ekf, delta_n, delta_e, 0.0)
    update_horizontal_position_reset_status(ekf, delta_n, delta_e)
    # PX4 takes off all that this update has reset so far, earlier resets once more
    change = ekf.state_reset.pos_ne_change
    shift_external_vision_position_bias(ekf, change[0], change[1])
    ekf.time_last_hor_pos_fuse = ekf.time_delayed_us


@kernel
def _project_and_reset(ekf, params, lat_rad, lon_rad, var_n, var_e):
    north, east = project_to_local(ekf, lat_rad, lon_rad)
    _reset_north_east(ekf, params, north, east, var_n, var_e)


@kernel
def _reproject_and_reset(ekf, params, north, east, var_n, var_e):
    lat_rad, lon_rad = reproject_to_global(ekf, north, east)
    _reset_lat_lon(ekf, params, lat_rad, lon_rad, var_n, var_e)


reset_horizontal_position_to = by_release(_reset_lat_lon, "keeps_position_local", _project_and_reset)
"""Set latitude and longitude (rad) and the variances (m²) of the horizontal position."""

reset_local_horizontal_position_to = by_release(_reproject_and_reset, "keeps_position_local", _reset_north_east)
"""Set the horizontal position to a place given in the local frame (m)."""


@kernel
def _reset_to_last_lat_lon(ekf, params, variance):
    _reset_lat_lon(ekf, params, ekf.last_known_lat, ekf.last_known_lon, variance, variance)


@kernel
def _reset_to_last_north_east(ekf, params, variance):
    local = ekf.local
    _reset_north_east(ekf, params, local.last_known_north, local.last_known_east, variance, variance)


_reset_to_last_known = by_release(_reset_to_last_lat_lon, "keeps_position_local", _reset_to_last_north_east)


@kernel
def reset_horizontal_position_to_last_known(ekf, params):
    """Return to the last horizontal position that was aided."""
    ekf.events.reset_pos_to_last_known = True
    _reset_to_last_known(ekf, params, params.EKF2_NOAID_NOISE**2)


@kernel
def _move_terrain_along(ekf, delta_d):
    update_terrain_reset_status(ekf, delta_d)
    ekf.terrain = single_precision(ekf.terrain + delta_d)


@kernel
def _leave_terrain(ekf, delta_d):
    """Until v1.14 the terrain stays where it was, and its filter finds the new height."""


_move_terrain = by_release(_move_terrain_along, "leaves_terrain_at_height_resets", _leave_terrain)


@kernel
def _shift_nothing(ekf, delta_d):
    """v1.16's range finder has no bias."""


@kernel
def _shift_bias_of_range(ekf, delta_d):
    ekf.rng_hgt_b_est.bias += delta_d


_shift_range_bias = by_release(_shift_nothing, "takes_range_for_height", _shift_bias_of_range)


@kernel
def reset_altitude_to(ekf, params, altitude, var):
    """Set the altitude (m) and its variance; height biases and the terrain move along."""
    altitude = single_precision(altitude)
    delta_d = -single_precision(altitude - ekf.gpos_alt)
    ekf.gpos_alt = altitude
    _reset_variance(ekf, POSITION + 2, var)
    apply_position_reset(ekf, 0.0, 0.0, delta_d)
    update_vertical_position_reset_status(ekf, delta_d)
    if _is_bias_shifted(ekf, ekf.cs.baro_hgt):
        ekf.baro_b_est.bias += delta_d
    if _is_bias_shifted(ekf, ekf.cs.ev_hgt):
        ekf.ev_hgt_b_est.bias -= delta_d
    if _is_bias_shifted(ekf, ekf.cs.gps_hgt):
        ekf.gps_hgt_b_est.bias += delta_d
    _shift_range_bias(ekf, delta_d)
    _move_terrain(ekf, delta_d)
    ekf.time_last_hgt_fuse = ekf.time_delayed_us


@kernel
def reset_height_to_last_known(ekf, params):
    """Return to the last altitude that was aided."""
    ekf.events.reset_pos_to_last_known = True
    reset_altitude_to(ekf, params, ekf.last_known_alt, params.EKF2_NOAID_NOISE**2)


@kernel
def _reset_yaw_error_variance(ekf, yaw_var):
    if math.isfinite(yaw_var) and yaw_var > FLT_EPSILON:
        reset_covariance_block(ekf, ATTITUDE + 2, 1, yaw_var)


@kernel
def _do_not_yet(ekf, yaw_var):
    """The covariance of the quaternion follows once it has turned."""


@kernel
def _done_already(ekf, yaw_var):
    """That of an error in the NED frame was set before the turn."""


@kernel
def _add_to_yaw_variance(ekf, yaw_var):
    uncorrelate_quaternion(ekf)
    if yaw_var > FLT_EPSILON:
        add_yaw_variance(ekf, yaw_var)


_set_yaw_variance = by_release(_reset_yaw_error_variance, "adds_quaternion_errors", _do_not_yet)
_uncorrelate_attitude = by_release(_done_already, "adds_quaternion_errors", _add_to_yaw_variance)


@kernel
def _hold_no_yaw(ekf):
    """The yaw at which the vehicle came to rest is held by v1.14 alone, v1.13 takes it anew."""


@kernel
def _hold_new_yaw(ekf):
    ekf.mag_modes.static_yaw = math.nan


_forget_static_yaw = by_release(
    by_release(_hold_no_yaw, "fuses_heading_or_field", _hold_new_yaw), "clears_field_whenever_stopped", _hold_no_yaw
)


@kernel
def reset_quat_state_yaw(ekf, params, yaw, yaw_var):
    """Set the yaw (rad) and its variance (rad², ignored unless positive), keeping the tilt."""
    _set_yaw_variance(ekf, yaw_var)
    yaw_before = euler_yaw(ekf.R_to_earth)
    before, error = ekf.scratch.quat_before, ekf.scratch.quat_error
    for i in range(4):
        before[i] = ekf.q[i]
    quat_to_dcm(ekf.q, ekf.scratch.R)
    update_yaw_in_rot_mat(yaw, ekf.scratch.R, ekf.R_to_earth)
    dcm_to_quat(ekf.R_to_earth, ekf.q)
    _uncorrelate_attitude(ekf, yaw_var)
    quat_multiply_inverse(ekf.q, before, error)
    quat_normalise(error)
    _propagate_quat_reset(ekf, error)
    ekf.time_last_heading_fuse = ekf.time_delayed_us
    _forget_static_yaw(ekf)
    _turn_velocity_along(ekf, params, wrap_pi(yaw - yaw_before))


@kernel
def _keep_velocity(ekf, params, turn):
    """v1.17 leaves the velocity where it is."""


@kernel
def _turn_unaided_velocity(ekf, params, turn):
    """Without north-east aiding the velocity was known relative to the heading alone."""
    if not is_north_east_aiding_active(ekf) and abs(turn) > LEAST_TURN_OF_VELOCITY:
        c, s, north, east = math.cos(turn), math.sin(turn), ekf.vel[0], ekf.vel[1]
        variance = max(ekf.P[VELOCITY, VELOCITY], ekf.P[VELOCITY + 1, VELOCITY + 1])
        reset_horizontal_velocity_to(ekf, params, c * north - s * east, s * north + c * east, variance, variance)


_turn_velocity_along = by_release(_keep_velocity, "turns_velocity_with_yaw", _turn_unaided_velocity)


@kernel
def _propagate_quat_reset(ekf, error):
    """Tell the output predictor and the external vision filter of an attitude jump, and record it."""
    apply_quaternion_reset(ekf, error)
    if ekf.ev.q_error_initialized:
        quat_multiply(error, ekf.ev.q_error_filt, ekf.ev.q_error_filt)
        quat_normalise(ekf.ev.q_error_filt)
    reset = ekf.state_reset
    if reset.quat_counter == ekf.state_reset_prev.quat_counter:
        for i in range(4):
            reset.quat_change[i] = error[i]
    else:
        quat_multiply(error, reset.quat_change, reset.quat_change)
        quat_normalise(reset.quat_change)
    reset.quat_counter = _next(reset.quat_counter)
