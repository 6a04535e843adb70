"""Innovation variance and Kalman gain of a scalar observation, from its Jacobian by the error state."""

from fusetune.ekf2.kernel import kernel
from fusetune.ekf2.state import ERROR_STATE_SIZE


@kernel
def compute_innovation_variance(ekf, H, R):
    """H P Hᵀ + R for a Jacobian `H` (24,) that is mostly zero."""
    P = ekf.P
    variance = R
    for i in range(ERROR_STATE_SIZE):
        if H[i] != 0.0:
            row = 0.0
            for j in range(ERROR_STATE_SIZE):
                if H[j] != 0.0:
                    row += P[i, j] * H[j]
            variance += H[i] * row
    return variance


@kernel
def compute_kalman_gain(ekf, H, innovation_variance, K):
    """Write P Hᵀ / innovation_variance into `K` (24,)."""
    P = ekf.P
    inverse = 1.0 / innovation_variance
    for i in range(ERROR_STATE_SIZE):
        K[i] = 0.0
    for j in range(ERROR_STATE_SIZE):
        weight = H[j] * inverse
        if weight != 0.0:
            for i in range(ERROR_STATE_SIZE):
                K[i] += P[j, i] * weight


@kernel
def clear_jacobian(H):
    """Set every element of `H` (24,) to zero."""
    for i in range(ERROR_STATE_SIZE):
        H[i] = 0.0
