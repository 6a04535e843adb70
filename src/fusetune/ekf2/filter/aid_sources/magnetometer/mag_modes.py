"""The two modes of the magnetometer until v1.14: `cs.mag_hdg` fuses the heading, `cs.mag_3d` the field.

The field needs a vehicle that was aligned in flight and that accelerates or turns enough to tell heading or body field.
Its states have a covariance only while it is fused; that is kept for the next time.

Mirrors the starts and stops of PX4 v1.14 `EKF/mag_control.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.aid_sources.magnetometer.mag_heading import update_yaw_observability
from fusetune.ekf2.filter.common.conditions import is_north_east_aiding_active
from fusetune.ekf2.filter.common.field_parameters import (
    DECLINATION_FUSED,
    MAG_TYPE_3D,
    MAG_TYPE_HEADING,
    MAG_TYPE_INDOOR,
)
from fusetune.ekf2.filter.common.timing import horizon_us
from fusetune.ekf2.filter.quaternion_core.field_covariance import restore_field_covariance
from fusetune.ekf2.filter.source_stops.heading_and_field import stop_field, stop_heading

SUITABLE_FOR_US = 2_000_000
SUSTAINED_SHARE = 0.5


@kernel
def _start_heading(ekf):
    if not ekf.cs.mag_hdg:
        stop_field(ekf)
        ekf.cs.mag_hdg = True


@kernel
def _start_field(ekf):
    if not ekf.cs.mag_3d:
        stop_heading(ekf)
        restore_field_covariance(ekf)
        ekf.cs.mag_3d = True


@kernel
def select_mode(ekf, params):
    """Fuse the heading or the field, as EKF2_MAG_TYPE says, which may leave it to how the vehicle moves."""
    mag_type = int(params.EKF2_MAG_TYPE)
    if mag_type in (MAG_TYPE_HEADING, MAG_TYPE_INDOOR):
        _start_heading(ekf)
    elif mag_type == MAG_TYPE_3D or _may_fuse_field(ekf, params):
        _start_field(ekf)
    else:
        _start_heading(ekf)


@kernel
def _may_fuse_field(ekf, params):
    """Whether the field is aligned in flight, and heading or body field could be told within 2 s."""
    update_yaw_observability(ekf, params)
    _update_bias_observability(ekf, params)
    modes = ekf.mag_modes
    if modes.bias_observable or ekf.field_history.yaw_observable:
        modes.time_last_suitable = horizon_us(ekf)
    return ekf.cs.mag_aligned_in_flight and horizon_us(ekf) - modes.time_last_suitable < SUITABLE_FOR_US


@kernel
def _update_bias_observability(ekf, params):
    """The body field can be told above a turn rate of EKF2_MAG_YAWLIM (rad/s), and then above half of it on average."""
    modes = ekf.mag_modes
    limit = params.EKF2_MAG_YAWLIM
    if not modes.bias_observable:
        modes.bias_observable = abs(modes.turn_rate_lpf) > limit
    else:
        duration = (horizon_us(ekf) - modes.time_turn_started) * 1e-6
        modes.bias_observable = abs(modes.turn) > SUSTAINED_SHARE * limit * duration
    modes.turn = 0.0
    modes.time_turn_started = horizon_us(ekf)


@kernel
def update_declination_mode(ekf, params):
    """A fused field needs the declination where GNSS does not tell north, or where EKF2_DECL_TYPE wants it."""
    is_wanted = (int(params.EKF2_DECL_TYPE) & DECLINATION_FUSED) != 0
    ekf.cs.mag_dec = ekf.cs.mag_3d and (is_wanted or not is_north_east_aiding_active(ekf))
