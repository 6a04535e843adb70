"""The yaw estimator of the release at hand: with quaternions, or with rotation matrices until v1.15."""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.yaw_estimator.gaussian_sum import fuse_gsf_velocity, predict_gsf
from fusetune.ekf2.filter.yaw_estimator.gsf_memory import initialise_gsf_memory
from fusetune.ekf2.filter.yaw_estimator.matrix_bank import (
    fuse_matrix_bank_velocity,
    initialise_matrix_bank,
    predict_matrix_bank,
)
from fusetune.ekf2.releases.by_release import by_release


@kernel
def _initialise_quaternions(ekf):
    initialise_gsf_memory(ekf.gsf)


@kernel
def _initialise_matrices(ekf):
    initialise_gsf_memory(ekf.gsf)
    initialise_matrix_bank(ekf.yaw_matrices)


initialise_yaw_bank = by_release(_initialise_quaternions, "keeps_yaw_bank_as_matrices", _initialise_matrices)
"""What is not zero at start."""


@kernel
def _predict_quaternions(ekf, imu, in_air):
    predict_gsf(ekf.gsf, imu, in_air)


predict_yaw_bank = by_release(_predict_quaternions, "keeps_yaw_bank_as_matrices", predict_matrix_bank)
"""Propagate all models by one IMU sample."""


@kernel
def _fuse_into_quaternions(ekf, vel_n, vel_e, vel_accuracy, in_air):
    fuse_gsf_velocity(ekf.gsf, vel_n, vel_e, vel_accuracy, in_air)


fuse_yaw_bank_velocity = by_release(_fuse_into_quaternions, "keeps_yaw_bank_as_matrices", fuse_matrix_bank_velocity)
"""Fuse a horizontal velocity (m/s) of given accuracy."""
