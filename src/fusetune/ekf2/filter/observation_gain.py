"""Innovation variance and Kalman gain of a scalar observation, from its Jacobian by the error state.

PX4 has these products in its generated equations; here one kernel serves every observation. What it finds stands in
`ekf.scratch` (`PH`, `HPH`, `K`), where the update takes it from.
"""

from fusetune.ekf2.compiled.kernel import kernel
from fusetune.ekf2.filter.common.state import ERROR_STATE_SIZE
from fusetune.ekf2.filter.quaternion_core.quaternion_update import scale_gain
from fusetune.ekf2.releases.by_release import by_release


@kernel
def multiply_covariance(ekf, H):
    """Write P Hᵀ into `ekf.scratch.PH` (24,) and H P Hᵀ into `ekf.scratch.HPH`.

    The states come in threes (attitude, velocity, …), so P is read three rows at a time, where H (24,) is not zero.
    """
    P, PH = ekf.P, ekf.scratch.PH
    for i in range(ERROR_STATE_SIZE):
        PH[i] = 0.0
    for j in range(0, ERROR_STATE_SIZE, 3):
        h0, h1, h2 = H[j], H[j + 1], H[j + 2]
        if h0 != 0.0 or h1 != 0.0 or h2 != 0.0:
            for i in range(ERROR_STATE_SIZE):
                PH[i] = PH[i] + h0 * P[j, i] + h1 * P[j + 1, i] + h2 * P[j + 2, i]
    ekf.scratch.HPH = _dot(H, PH)


@kernel
def _dot(a, b):
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
    multiply_covariance(ekf, H)
    return ekf.scratch.HPH + R


@kernel
def compute_kalman_gain(ekf, H, innovation_variance):
    """Write the gain P Hᵀ / innovation_variance into `ekf.scratch.K` (24,)."""
    multiply_covariance(ekf, H)
    scale_kalman_gain(ekf, innovation_variance)


@kernel
def _scale_by_inverse(ekf, innovation_variance):
    K, PH = ekf.scratch.K, ekf.scratch.PH
    inverse = 1.0 / innovation_variance
    for i in range(ERROR_STATE_SIZE):
        K[i] = PH[i] * inverse


scale_kalman_gain = by_release(_scale_by_inverse, "adds_quaternion_errors", scale_gain)
"""Write the gain of the Jacobian that `ekf.scratch.PH` was last computed for into `ekf.scratch.K` (24,)."""


@kernel
def clear_jacobian(H):
    """Set every element of `H` (24,) to zero."""
    for i in range(ERROR_STATE_SIZE):
        H[i] = 0.0
