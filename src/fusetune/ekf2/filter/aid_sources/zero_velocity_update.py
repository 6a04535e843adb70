"""Zero velocity while the vehicle is at rest: levels the attitude and holds the velocity.

Mirrors PX4 v1.16 `EKF/aid_sources/ZeroVelocityUpdate.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.conditions import is_vertical_velocity_aiding_active
from fusetune.ekf2.filter.common.state import VELOCITY
from fusetune.ekf2.filter.measurement_update import fuse_direct_state
from fusetune.ekf2.releases.by_release import by_release, does

UPDATE_INTERVAL_US = 200_000
VARIANCE_WHILE_LEVELLING = 0.001**2
VARIANCE_AFTERWARDS = 0.2**2

_yields_before_alignment = does("yields_to_velocity_before_alignment")


@kernel
def _fuse_one_after_the_other(ekf, params, innovation_variance, variance):
    for i in range(3):
        fuse_direct_state(ekf, params, ekf.vel[i], innovation_variance[i], variance, VELOCITY + i)


@kernel
def _fuse_what_was_found(ekf, params, innovation_variance, variance):
    """An axis is corrected by the velocity that there was before another one was."""
    innovation = ekf.vel[0], ekf.vel[1], ekf.vel[2]
    for i in range(3):
        fuse_direct_state(ekf, params, innovation[i], innovation_variance[i], variance, VELOCITY + i)


_fuse_zero = by_release(_fuse_one_after_the_other, "finds_zero_velocity_first", _fuse_what_was_found)


@kernel
def control_zero_velocity_update(ekf, params):
    """Fuse zero velocity every 0.2 s; after tilt alignment only while nothing aids the vertical velocity.

    Together with such aiding the filter would be too stiff to follow a drift of position.
    """
    if ekf.time_last_zero_velocity_fuse + UPDATE_INTERVAL_US >= ekf.time_delayed_us:
        return
    if not (ekf.cs.vehicle_at_rest and ekf.cs_prev.vehicle_at_rest):
        return
    if is_vertical_velocity_aiding_active(ekf) and (ekf.cs.tilt_align or _yields_before_alignment(ekf)):
        return
    variance = VARIANCE_AFTERWARDS if ekf.cs.tilt_align else VARIANCE_WHILE_LEVELLING
    innovation_variance = (
        ekf.P[VELOCITY, VELOCITY] + variance,
        ekf.P[VELOCITY + 1, VELOCITY + 1] + variance,
        ekf.P[VELOCITY + 2, VELOCITY + 2] + variance,
    )
    _fuse_zero(ekf, params, innovation_variance, variance)
    ekf.time_last_zero_velocity_fuse = ekf.time_delayed_us
