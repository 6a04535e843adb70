"""Blocks of the covariance matrix: uncorrelated, or given new variances."""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.state import ERROR_STATE_SIZE


@kernel
def uncorrelate_block(ekf, index, dof):
    """Zero every covariance of the states [index, index + dof), among themselves and with the others."""
    P = ekf.P
    for i in range(index, index + dof):
        variance = P[i, i]
        for j in range(ERROR_STATE_SIZE):
            P[i, j] = 0.0
            P[j, i] = 0.0
        P[i, i] = variance


@kernel
def reset_covariance_block(ekf, index, dof, variance):
    """Uncorrelate the states [index, index + dof) and give them all the same variance."""
    uncorrelate_block(ekf, index, dof)
    for i in range(index, index + dof):
        ekf.P[i, i] = variance


@kernel
def uncorrelate_set_variance_vector(ekf, index, v0, v1, v2):
    """Uncorrelate three states from `index` on and set their variances."""
    uncorrelate_block(ekf, index, 3)
    ekf.P[index, index] = v0
    ekf.P[index + 1, index + 1] = v1
    ekf.P[index + 2, index + 2] = v2


@kernel
def zero_covariance_block(ekf, index, dof):
    """Zero the rows and columns of the states [index, index + dof), variances and all."""
    P = ekf.P
    for i in range(index, index + dof):
        for j in range(ERROR_STATE_SIZE):
            P[i, j] = 0.0
            P[j, i] = 0.0
