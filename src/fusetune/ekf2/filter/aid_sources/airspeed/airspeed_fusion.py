"""Prediction and fusion of true airspeed.

h = |v - w|; ∂h/∂v = (v - w)/h and ∂h/∂w its negative. Unless the filter is dead reckoning by the wind, only the wind
states move. Mirrors PX4 v1.16 `EKF/aid_sources/airspeed/airspeed_fusion.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.airspeed.airspeed_resets import airspeed_variance, reset_wind_using_airspeed
from fusetune.ekf2.filter.common.aid_source_status import set_axis, update_aid_source_status
from fusetune.ekf2.filter.common.state import VELOCITY, WIND
from fusetune.ekf2.filter.covariance import initialise_covariance
from fusetune.ekf2.filter.observation_gain import clear_jacobian, compute_innovation_variance
from fusetune.ekf2.filter.wind import air_velocity, fuse_into_wind
from fusetune.ekf2.numerics.constants import FLT_EPSILON
from fusetune.ekf2.releases.by_release import by_release


@kernel
def predict_airspeed(ekf):
    """Speed (m/s) of the vehicle through the air."""
    x, y, z = air_velocity(ekf)
    return math.sqrt(x * x + y * y + z * z + FLT_EPSILON)


@kernel
def compute_airspeed_jacobian(ekf, H):
    """Write the derivative of the airspeed into `H` (24,)."""
    inverse = 1.0 / predict_airspeed(ekf)
    clear_jacobian(H)
    for i in range(2):
        H[VELOCITY + i] = (ekf.vel[i] - ekf.wind_vel[i]) * inverse
        H[WIND + i] = -H[VELOCITY + i]
    H[VELOCITY + 2] = ekf.vel[2] * inverse


@kernel
def update_airspeed(ekf, params):
    """Judge the airspeed that is due now."""
    sample, H = ekf.sensors.airspeed.sample, ekf.airspeed.H
    variance = airspeed_variance(params, sample.eas2tas)
    compute_airspeed_jacobian(ekf, H)
    innovation = predict_airspeed(ekf) - sample.true_airspeed
    innovation_variance = compute_innovation_variance(ekf, H, variance)
    set_axis(ekf.aid.airspeed, 0, sample.true_airspeed, variance, innovation, innovation_variance)
    update_aid_source_status(ekf, ekf.aid.airspeed, 1, sample.time_us, max(params.EKF2_TAS_GATE, 1.0))


@kernel
def _is_velocity(ekf):
    ekf.time_last_hor_vel_fuse = ekf.time_delayed_us


@kernel
def _is_no_velocity(ekf):
    """The time-out of horizontal velocity goes on."""


_count_as_velocity = by_release(_is_velocity, "asks_airspeed_for_wings", _is_no_velocity)


@kernel
def fuse_airspeed(ekf, params):
    """Fuse the judged airspeed unless it was rejected."""
    aid = ekf.aid.airspeed
    if aid.innovation_rejected:
        return
    update_wind_only = not ekf.cs.wind_dead_reckoning
    variance = aid.innovation_variance[0]
    if variance < aid.observation_variance[0] or variance < FLT_EPSILON:
        _recover_from_bad_covariance(ekf, params, update_wind_only)
        return
    ekf.fs.bad_airspeed = False
    fuse_into_wind(ekf, params, aid, ekf.airspeed.H, update_wind_only)
    if not update_wind_only:
        _count_as_velocity(ekf)


@kernel
def _recover_from_bad_covariance(ekf, params, update_wind_only):
    if update_wind_only:
        reset_wind_using_airspeed(ekf, params)
    else:
        initialise_covariance(ekf, params)
        ekf.wind_vel[0], ekf.wind_vel[1] = 0.0, 0.0
    ekf.fs.bad_airspeed = True
