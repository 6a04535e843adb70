"""What v1.13 tells the yaw estimator: the airspeed, and after its run a velocity for the next.

Mirrors `runYawEKFGSF` of PX4 v1.13 `EKF/ekf_helper.cpp`.
"""

import math

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sample_arrival import is_fusion_due
from fusetune.ekf2.filter.yaw_estimator.gsf_memory import set_true_airspeed
from fusetune.ekf2.filter.yaw_estimator.matrix_bank import run_matrix_bank_in_air, tell_matrix_bank_velocity
from fusetune.ekf2.numerics.constants import FLT_EPSILON

AIRSPEED_AGE_US = 1_000_000


@kernel
def run_told_matrix_bank(ekf, params):
    """Run the bank over the update, then tell it the velocity of a sample that is due, as accurate as its height."""
    set_true_airspeed(ekf.gsf, _airspeed(ekf, params))
    run_matrix_bank_in_air(ekf, ekf.imu_delayed, ekf.cs.in_air)
    taken = ekf.gnss_taken
    north, east = taken.vel[0], taken.vel[1]
    if is_fusion_due(ekf.sensors.gnss) and taken.vacc > FLT_EPSILON and math.isfinite(north + east):
        tell_matrix_bank_velocity(ekf, north, east, taken.vacc)


@kernel
def _airspeed(ekf, params):
    """Airspeed (m/s) of a fixed wing, 0 where none is to be reckoned with."""
    if not ekf.cs.fixed_wing:
        return 0.0
    sample = ekf.sensors.airspeed.sample
    if sample.time_us + AIRSPEED_AGE_US < ekf.time_latest_us:
        return params.EKF2_GSF_TAS
    return sample.true_airspeed if sample.true_airspeed >= params.EKF2_ARSP_THR else 0.0
