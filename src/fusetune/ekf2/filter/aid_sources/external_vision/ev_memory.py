"""What the external vision aid sources remember between updates, and the bits of `EKF2_EV_CTRL`."""

import numpy as np

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.feed.sensor_samples import EV_SAMPLE

EV_MEMORY = np.dtype(
    [
        ("prev", EV_SAMPLE),
        ("newest_quality", "i8"),
        ("time_last_buffer_push_us", "i8"),
        ("q_error_filt", "f8", (4,)),
        ("q_error_initialized", "?"),
        ("R_ev_to_ekf", "f8", (3, 3)),
        ("vel_measurement", "f8", (3,)),
        ("vel_measurement_var", "f8", (3,)),
        ("body_velocity_jacobian", "f8", (3, 6)),
        ("nb_pos_reset_available", "i8"),
        ("nb_vel_reset_available", "i8"),
        ("nb_yaw_reset_available", "i8"),
    ],
    align=True,
)
"""Sub-record `ekf.ev`.

`prev` is the last sample of sufficient quality, `newest_quality` that of the sample pushed last
into the buffer, at the IMU time `time_last_buffer_push_us`.
`q_error_filt` is the filtered rotation from the vision frame to NED, `R_ev_to_ekf` work space for its matrix.
The position and height biases are `ekf.ev_pos_b_est` and `ekf.ev_hgt_b_est`.
"""

EV_CTRL_HPOS, EV_CTRL_VPOS, EV_CTRL_VEL, EV_CTRL_YAW = 1, 2, 4, 8

RESETS_AVAILABLE_AT_START = 5
MIN_NOISE = 0.01


@kernel
def initialise_ev_memory(ev):
    """Forget everything; vision and NED frame are taken to agree."""
    ev.prev.time_us = 0
    ev.prev.reset_counter = 0
    ev.prev.quality = 0
    ev.newest_quality = 0
    ev.time_last_buffer_push_us = 0
    ev.q_error_filt[0] = 1.0
    for i in range(1, 4):
        ev.q_error_filt[i] = 0.0
    ev.q_error_initialized = False
    ev.nb_pos_reset_available = 0
    ev.nb_vel_reset_available = 0
    ev.nb_yaw_reset_available = 0


@kernel
def is_yaw_alignment_changed(ekf):
    """Whether the yaw that vision positions and velocities refer to was newly aligned in this update."""
    return (not ekf.cs_prev.ev_yaw and ekf.cs.ev_yaw) or (ekf.cs_prev.yaw_align != ekf.cs.yaw_align)


@kernel
def sensor_offset_body(params):
    """Position (m, FRD) of the vision sensor relative to the IMU."""
    return (
        params.EKF2_EV_POS_X - params.EKF2_IMU_POS_X,
        params.EKF2_EV_POS_Y - params.EKF2_IMU_POS_Y,
        params.EKF2_EV_POS_Z - params.EKF2_IMU_POS_Z,
    )


@kernel
def sensor_velocity_body(ekf, params):
    """Velocity (m/s, FRD) of the vision sensor relative to the IMU, from the vehicle's rotation."""
    imu = ekf.imu_delayed
    wx = imu.delta_ang[0] / imu.delta_ang_dt - ekf.gyro_bias[0]
    wy = imu.delta_ang[1] / imu.delta_ang_dt - ekf.gyro_bias[1]
    wz = imu.delta_ang[2] / imu.delta_ang_dt - ekf.gyro_bias[2]
    px, py, pz = sensor_offset_body(params)
    return wy * pz - wz * py, wz * px - wx * pz, wx * py - wy * px


@kernel
def rotate(R, axis, x, y, z):
    """Component `axis` of R (x, y, z)."""
    return R[axis, 0] * x + R[axis, 1] * y + R[axis, 2] * z


@kernel
def rotate_variance(R, axis, variance):
    """Variance of component `axis` of a vector with independent components, after rotation by `R`."""
    return (
        R[axis, 0] * R[axis, 0] * variance[0]
        + R[axis, 1] * R[axis, 1] * variance[1]
        + R[axis, 2] * R[axis, 2] * variance[2]
    )
