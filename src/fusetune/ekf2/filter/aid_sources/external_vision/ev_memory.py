"""What the external vision aid sources remember between updates, and the bits of `EKF2_EV_CTRL`."""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.record_fields import fields
from fusetune.ekf2.feed.sensor_samples import EV_SAMPLE
from fusetune.ekf2.filter.common.imu_rates import body_rate, measured_rate
from fusetune.ekf2.numerics.lever_arm import position_relative_to_imu, velocity_of_offset
from fusetune.ekf2.releases.by_release import by_release

EV_MEMORY = np.dtype(
    [
        ("prev", EV_SAMPLE),
        ("newest_quality", "i8"),
        ("q_error_filt", "f8", (4,)),
        ("q_error_initialized", "?"),
        ("R_ev_to_ekf", "f8", (3, 3)),
        ("vel_measurement", "f8", (3,)),
        ("vel_measurement_var", "f8", (3,)),
        ("body_velocity_jacobian", "f8", (3, 6)),
        *fields("i8", "nb_pos_reset_available", "nb_vel_reset_available", "nb_yaw_reset_available"),
    ],
    align=True,
)
"""Sub-record `ekf.ev`.

`prev` is the last sample of sufficient quality, `newest_quality` that of the sample buffered last.
`q_error_filt` is the filtered rotation from the vision frame to NED, `R_ev_to_ekf` work space for its matrix.
The position and height biases are `ekf.ev_pos_b_est` and `ekf.ev_hgt_b_est`.
"""

EV_CTRL_HPOS, EV_CTRL_VPOS, EV_CTRL_VEL, EV_CTRL_YAW = 1, 2, 4, 8

RESETS_AVAILABLE_AT_START = 5
MIN_NOISE = 0.01


@kernel
def initialise_ev_memory(ev):
    """What is not zero at start: vision and NED frame are taken to agree."""
    ev.q_error_filt[0] = 1.0


@kernel
def is_yaw_alignment_changed(ekf):
    """Whether the yaw that vision positions and velocities refer to was newly aligned in this update."""
    return (not ekf.cs_prev.ev_yaw and ekf.cs.ev_yaw) or (ekf.cs_prev.yaw_align != ekf.cs.yaw_align)


_swing_rate = by_release(body_rate, "levers_by_measured_rate", measured_rate)


@kernel
def sensor_velocity_body(ekf, params):
    """Velocity (m/s, FRD) of the vision sensor relative to the IMU, from the vehicle's rotation."""
    wx, wy, wz = _swing_rate(ekf)
    px, py, pz = sensor_offset_body(params)
    return velocity_of_offset(wx, wy, wz, px, py, pz)


@kernel
def sensor_offset_body(params):
    """Position (m, FRD) of the vision sensor relative to the IMU."""
    return position_relative_to_imu(params, params.EKF2_EV_POS_X, params.EKF2_EV_POS_Y, params.EKF2_EV_POS_Z)
