"""Operator commands that act on the estimator: origin, external position, external wind (`vehicle_command`).

Behaviour of the command handling in PX4 v1.16's EKF2 module and of `resetGlobalPosToExternalObservation`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common import state as S
from fusetune.ekf2.filter.common.conditions import is_local_horizontal_position_valid
from fusetune.ekf2.filter.common.local_origin import is_altitude_plausible, is_lat_lon_plausible
from fusetune.ekf2.filter.measurement_update import fuse_direct_state, measurement_update
from fusetune.ekf2.filter.observation_gain import clear_jacobian, compute_kalman_gain
from fusetune.ekf2.filter.output_predictor.output_predictor import apply_position_reset
from fusetune.ekf2.filter.resets.origin_resets import initialise_altitude_to, reset_lat_lon_to, set_ekf_global_origin
from fusetune.ekf2.filter.resets.state_resets import (
    reset_altitude_to,
    reset_horizontal_position_to,
    update_horizontal_position_reset_status,
)
from fusetune.ekf2.filter.wind import reset_wind_to_external_observation
from fusetune.ekf2.numerics.geodesy import add_to_lat_lon, lat_lon_difference
from fusetune.ekf2.releases.by_release import by_release
from fusetune.ekf2.replay.older_commands import move_local_origin, take_given_position

SET_GPS_GLOBAL_ORIGIN = 100000
EXTERNAL_POSITION_ESTIMATE = 43003
EXTERNAL_WIND_ESTIMATE = 43004

MAX_EXTERNAL_DELAY_S = 15.0
DEFAULT_EXTERNAL_ACCURACY_M = 50.0
HARD_RESET_ACCURACY_M = 1.0
EXTERNAL_GATE = 5.0
MIN_EXTERNAL_VARIANCE = 0.01**2


@kernel
def _handle_globally(ekf, params, message):
    p = message.param
    if message.command == SET_GPS_GLOBAL_ORIGIN:
        set_ekf_global_origin(ekf, params, math.radians(p[4]), math.radians(p[5]), p[6], math.nan, math.nan)
    elif message.command == EXTERNAL_POSITION_ESTIMATE:
        navigating_blind = ekf.cs.wind_dead_reckoning or ekf.cs.inertial_dead_reckoning
        waiting_on_ground = not ekf.cs.in_air and not ekf.cs.gnss_pos
        complete = math.isfinite(p[1]) and math.isfinite(p[4]) and math.isfinite(p[5])
        if complete and (navigating_blind or waiting_on_ground):
            delay_us = int(min(max(p[1], 0.0), MAX_EXTERNAL_DELAY_S) * 1e6)
            accuracy = p[2] if math.isfinite(p[2]) and p[2] > 0.0 else DEFAULT_EXTERNAL_ACCURACY_M
            take_external_position(
                ekf, params, math.radians(p[4]), math.radians(p[5]), p[6], accuracy, message.timestamp - delay_us
            )
    elif message.command == EXTERNAL_WIND_ESTIMATE:
        blows_to = math.radians(p[2]) + math.pi
        reset_wind_to_external_observation(ekf, p[0], blows_to, p[1], math.radians(p[3]))


@kernel
def _handle_locally(ekf, params, message):
    p = message.param
    if message.command == SET_GPS_GLOBAL_ORIGIN:
        move_local_origin(ekf, params, math.radians(p[4]), math.radians(p[5]), p[6])
    elif message.command == EXTERNAL_POSITION_ESTIMATE:
        take_given_position(ekf, params, message)


handle_command = by_release(_handle_globally, "keeps_position_local", _handle_locally)
"""Carry out one command; others than the three above do nothing."""


@kernel
def take_external_position(ekf, params, lat, lon, altitude, accuracy, timestamp):
    """Reset to, or fuse, a position (rad, m) that somebody reports for `timestamp` with an accuracy in m.

    It is carried on to the fusion time horizon with the present velocity. On the ground, with an accuracy better than
    1 m, or where it contradicts the estimate, the position is reset to it; otherwise it is fused.
    """
    if not is_lat_lon_plausible(lat, lon):
        return False
    variance = max(accuracy * accuracy, MIN_EXTERNAL_VARIANCE)
    if not ekf.origin.lat_lon_valid:
        reset_lat_lon_to(ekf, params, lat, lon, accuracy * accuracy)
        initialise_altitude_to(ekf, params, altitude, accuracy * accuracy)
        return True
    dt = 0.0
    if timestamp > 0 and is_local_horizontal_position_valid(ekf):
        dt = (ekf.time_delayed_us - min(timestamp, ekf.time_latest_us)) * 1e-6
    altitude_known = is_altitude_plausible(altitude)
    reference_alt = altitude if altitude_known else ekf.gpos_alt
    lat, lon = add_to_lat_lon(lat, lon, reference_alt, ekf.vel[0] * dt, ekf.vel[1] * dt)
    _take_horizontal(ekf, params, lat, lon, accuracy, variance)
    if altitude_known:
        _take_vertical(ekf, params, altitude - ekf.vel[2] * dt, accuracy, variance)
    return True


@kernel
def _take_horizontal(ekf, params, lat, lon, accuracy, variance):
    north, east = lat_lon_difference(ekf.gpos_lat, ekf.gpos_lon, ekf.gpos_alt, lat, lon)
    variance_n = ekf.P[S.POSITION, S.POSITION] + variance
    variance_e = ekf.P[S.POSITION + 1, S.POSITION + 1] + variance
    rejected = north * north / variance_n + east * east / variance_e > EXTERNAL_GATE * EXTERNAL_GATE
    if not ekf.cs.in_air or accuracy < HARD_RESET_ACCURACY_M or rejected:
        ekf.events.reset_pos_to_ext_obs = True
        reset_horizontal_position_to(ekf, params, lat, lon, variance, variance)
    else:
        _fuse_given_position(ekf, params, north, east, variance_n, variance_e, variance)
        ekf.time_last_hor_pos_fuse = ekf.time_delayed_us
    ekf.last_known_lat = lat
    ekf.last_known_lon = lon


@kernel
def _fuse_with_kalman_gain(ekf, params, north, east, variance_n, variance_e, variance):
    fuse_direct_state(ekf, params, north, variance_n, variance, S.POSITION)
    fuse_direct_state(ekf, params, east, variance_e, variance, S.POSITION + 1)


@kernel
def _fuse_with_gain_of_one(ekf, params, north, east, variance_n, variance_e, variance):
    """The position takes over the whole innovation, the other states what it tells of them; a reset is told."""
    _fuse_with_gain_on(ekf, params, north, variance_n, variance, S.POSITION)
    _fuse_with_gain_on(ekf, params, east, variance_e, variance, S.POSITION + 1)
    update_horizontal_position_reset_status(ekf, -north, -east)
    apply_position_reset(ekf, -north, -east, 0.0)


@kernel
def _fuse_with_gain_on(ekf, params, innovation, innovation_variance, variance, index):
    H = ekf.scratch.H
    clear_jacobian(H)
    H[index] = 1.0
    compute_kalman_gain(ekf, H, innovation_variance)
    ekf.scratch.K[index] = 1.0
    measurement_update(ekf, params, variance, innovation)


_fuse_given_position = by_release(_fuse_with_kalman_gain, "forces_given_position", _fuse_with_gain_of_one)


@kernel
def _take_vertical(ekf, params, altitude, accuracy, variance):
    innovation = altitude - ekf.gpos_alt
    innovation_variance = ekf.P[S.POSITION + 2, S.POSITION + 2] + variance
    rejected = innovation * innovation > EXTERNAL_GATE * EXTERNAL_GATE * innovation_variance
    if not ekf.cs.in_air or accuracy < HARD_RESET_ACCURACY_M or rejected:
        reset_altitude_to(ekf, params, altitude, variance)
        ekf.last_known_alt = altitude
    else:
        fuse_direct_state(ekf, params, innovation, innovation_variance, variance, S.POSITION + 2)
        ekf.time_last_hgt_fuse = ekf.time_delayed_us
