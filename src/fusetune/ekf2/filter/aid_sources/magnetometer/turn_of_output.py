"""How much the vehicle turns about down, by the newest IMU samples: v1.13 looks at those, v1.14 at the horizon.

Mirrors the yaw rate of `calculateOutputStates` of PX4 v1.13 `EKF/ekf.cpp`.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.releases.by_release import by_release

TURN_RATE_LPF_ALPHA = 0.05


@kernel
def _follow_nothing(ekf, imu):
    """Since v1.14 the filter's own prediction tells."""


@kernel
def _follow_newest(ekf, imu):
    """Note the turn of a sample, IMU_ROW, before the output predictor takes it.

    PX4 updates the filter before its output, so a sample counts only from the next on.
    """
    if not ekf.filter_initialised:
        return
    modes, output = ekf.mag_modes, ekf.output
    modes.turn += modes.turn_to_come
    modes.turn_rate_lpf += TURN_RATE_LPF_ALPHA * (modes.turn_rate_to_come - modes.turn_rate_lpf)
    turn = 0.0
    for axis in range(3):
        angle = imu.delta_ang[axis] - output.gyro_bias[axis] * imu.delta_ang_dt + output.delta_angle_corr[axis]
        turn += angle * output.R_to_earth[2, axis]
    modes.turn_to_come = turn
    modes.turn_rate_to_come = turn / imu.delta_ang_dt


follow_turn_of_output = by_release(_follow_nothing, "clears_field_whenever_stopped", _follow_newest)
"""Note what a new IMU sample tells of the turn."""
