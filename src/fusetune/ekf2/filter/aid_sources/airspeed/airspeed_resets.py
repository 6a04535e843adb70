"""Resets of wind and velocity to a true airspeed, as for level flight without sideslip.

Mirrors PX4 v1.16 `EKF/aid_sources/airspeed/airspeed_fusion.cpp`.
"""

import math

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.aid_source_status import reset_aid_source_status_zero_innovation
from fusetune.ekf2.filter.common.state import VELOCITY, WIND
from fusetune.ekf2.filter.covariance import reset_covariance_block, yaw_variance
from fusetune.ekf2.filter.resets.state_resets import reset_horizontal_velocity_to
from fusetune.ekf2.numerics.rotations import euler_yaw
from fusetune.ekf2.releases.by_release import by_release

SIDESLIP_AT_RESET = math.radians(15.0)
SIDESLIP_VARIANCE_AT_RESET = math.radians(15.0) ** 2
YAW_VARIANCE_AT_RESET = math.radians(10.0) ** 2


@kernel
def airspeed_variance(params, eas2tas):
    """Observation variance ((m/s)²) of true airspeed."""
    noise = min(max(params.EKF2_EAS_NOISE, 0.5), 5.0) * min(max(eas2tas, 0.9), 10.0)
    return noise * noise


@kernel
def reset_wind_using_airspeed(ekf, params):
    """Set the wind as for level flight without sideslip: velocity less airspeed along the heading.

    Its covariance takes in the variances of velocity, heading, airspeed and an assumed sideslip of 15° (one sigma),
    to first order.
    """
    airspeed = ekf.sensors.airspeed.sample.true_airspeed
    yaw = euler_yaw(ekf.R_to_earth)
    c, s = math.cos(yaw), math.sin(yaw)
    ekf.wind_vel[0] = ekf.vel[0] - airspeed * c
    ekf.wind_vel[1] = ekf.vel[1] - airspeed * s
    _reset_wind_covariance(ekf, params, airspeed, c, s)
    reset_aid_source_status_zero_innovation(ekf, ekf.aid.airspeed, 1)


@kernel
def _carry_variances(ekf, params, airspeed, c, s):
    along = airspeed_variance(params, ekf.sensors.airspeed.sample.eas2tas)
    across = airspeed * airspeed * (yaw_variance(ekf) + SIDESLIP_VARIANCE_AT_RESET)
    var_north, var_east = ekf.P[VELOCITY, VELOCITY], ekf.P[VELOCITY + 1, VELOCITY + 1]
    reset_covariance_block(ekf, WIND, 2, 0.0)
    ekf.P[WIND, WIND] = var_north + c * c * along + s * s * across
    ekf.P[WIND + 1, WIND + 1] = var_east + s * s * along + c * c * across
    ekf.P[WIND, WIND + 1] = c * s * (along - across)
    ekf.P[WIND + 1, WIND] = ekf.P[WIND, WIND + 1]


@kernel
def _carry_given_variances(ekf, params, airspeed, c, s):
    """The heading counts as known to 10°, and turns the wind alone."""
    along = airspeed_variance(params, ekf.sensors.airspeed.sample.eas2tas)
    across = (airspeed * math.sin(SIDESLIP_AT_RESET)) ** 2
    var_north, var_east = ekf.P[VELOCITY, VELOCITY], ekf.P[VELOCITY + 1, VELOCITY + 1]
    # derivatives of the wind by the heading, as it turns with the vehicle
    ahead = ekf.wind_vel[0] * c + ekf.wind_vel[1] * s
    right = -ekf.wind_vel[0] * s + ekf.wind_vel[1] * c
    north, east = -ahead * s - right * c, ahead * c - right * s
    reset_covariance_block(ekf, WIND, 2, 0.0)
    ekf.P[WIND, WIND] = along * c * c + YAW_VARIANCE_AT_RESET * north * north + across * s * s + var_north
    ekf.P[WIND + 1, WIND + 1] = along * s * s + YAW_VARIANCE_AT_RESET * east * east + across * c * c + var_east
    ekf.P[WIND, WIND + 1] = (along - across) * s * c + YAW_VARIANCE_AT_RESET * north * east
    ekf.P[WIND + 1, WIND] = ekf.P[WIND, WIND + 1]


_reset_wind_covariance = by_release(_carry_variances, "starts_airspeed_by_wind", _carry_given_variances)


@kernel
def reset_vel_using_airspeed(ekf, params):
    """Set the velocity as for level flight without sideslip in the wind last known; its variance stays."""
    airspeed = ekf.sensors.airspeed.sample.true_airspeed
    yaw = euler_yaw(ekf.R_to_earth)
    north = ekf.wind_vel[0] + airspeed * math.cos(yaw)
    east = ekf.wind_vel[1] + airspeed * math.sin(yaw)
    reset_horizontal_velocity_to(ekf, params, north, east, np.nan, np.nan)
    ekf.aid.airspeed.time_last_fuse = ekf.time_delayed_us
