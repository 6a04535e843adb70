"""Innovation variance and Kalman gain of a scalar observation, from its Jacobian by the error state."""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.state import ERROR_STATE_SIZE


@kernel
def multiply_covariance(P, H, PH):
    """Write P Hᵀ into `PH` (24,), row by row of the symmetric P where H is not zero."""
    for i in range(ERROR_STATE_SIZE):
        PH[i] = 0.0
    for j in range(ERROR_STATE_SIZE):
        h = H[j]
        if h != 0.0:
            for i in range(ERROR_STATE_SIZE):
                PH[i] += h * P[j, i]


@kernel
def dot(a, b):
    """Inner product of two vectors of 24 elements, in four sums that the processor can run side by side."""
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    for i in range(0, ERROR_STATE_SIZE, 4):
        s0 += a[i] * b[i]
        s1 += a[i + 1] * b[i + 1]
        s2 += a[i + 2] * b[i + 2]
        s3 += a[i + 3] * b[i + 3]
    return (s0 + s1) + (s2 + s3)


@kernel
def compute_innovation_variance(ekf, H, R):
    """H P Hᵀ + R for a Jacobian `H` (24,) that is mostly zero."""
    PH = ekf.scratch.PH
    multiply_covariance(ekf.P, H, PH)
    return dot(H, PH) + R


@kernel
def compute_kalman_gain(ekf, H, innovation_variance, K):
    """Write P Hᵀ / innovation_variance into `K` (24,)."""
    multiply_covariance(ekf.P, H, K)
    inverse = 1.0 / innovation_variance
    for i in range(ERROR_STATE_SIZE):
        K[i] *= inverse


@kernel
def clear_jacobian(H):
    """Set every element of `H` (24,) to zero."""
    for i in range(ERROR_STATE_SIZE):
        H[i] = 0.0
