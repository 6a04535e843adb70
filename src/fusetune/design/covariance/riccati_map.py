"""What a stretch of time does to a covariance, as one map that can be joined with others and repeated.

Propagation and correction both have the form

    P ↦ Q + A P (I + G P)⁻¹ Aᵀ,

propagation with G = 0, a correction with A = I, Q = 0 and G = Hᵀ R⁻¹ H. Joined in a row they keep that form (the
doubling of Anderson and Moore, Optimal Filtering, 1979, section 6.7; as an associative product in Särkkä and
García-Fernández, IEEE Transactions on Automatic Control 66, 2021). So a period is one map, N periods take log₂ N
products, and the steady state is reached by squaring.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

MOST_DOUBLINGS = 80
"""2⁸⁰ periods: what has not settled by then does not."""
SETTLED = 1e-12
UNBOUNDED = 1e30
NOTHING = 1e-26
"""A variance that is no more to be told from 0: without noise of its own it falls for ever."""


@dataclass(frozen=True)
class RiccatiMap:
    """P ↦ Q + A P (I + G P)⁻¹ Aᵀ, all (n, n)."""

    A: Array
    G: Array
    Q: Array

    @classmethod
    def propagation(cls, A: Array, Q: Array) -> RiccatiMap:
        """P ↦ A P Aᵀ + Q."""
        return cls(A, np.zeros_like(Q), Q)

    @classmethod
    def correction(cls, H: Array, R: Array) -> RiccatiMap:
        """The update by y = H x + v of covariance R."""
        n = H.shape[1]
        return cls(np.eye(n), _symmetric(H.T @ np.linalg.solve(R, H)), np.zeros((n, n)))

    def __call__(self, P: Array) -> Array:
        """The covariance afterwards."""
        return _symmetric(self.Q + self.A @ P @ np.linalg.solve(np.eye(len(P)) + self.G @ P, self.A.T))

    def then(self, other: RiccatiMap) -> RiccatiMap:
        """This map, and the other one after it."""
        identity = np.eye(len(self.A))
        through = np.linalg.solve((identity + self.Q @ other.G).T, other.A.T).T
        return RiccatiMap(
            through @ self.A,
            _symmetric(self.G + self.A.T @ other.G @ np.linalg.solve(identity + self.Q @ other.G, self.A)),
            _symmetric(other.Q + through @ self.Q @ other.A.T),
        )

    def repeated(self, times: int) -> RiccatiMap:
        """This map so many times in a row, once at the least."""
        result, power, left = None, self, times
        while left:
            if left & 1:
                result = power if result is None else result.then(power)
            left >>= 1
            if left:
                power = power.then(power)
        assert result is not None
        return result

    def steady_state(self) -> Array | None:
        """The covariance that the map leaves as it is, from whatever start; None where some of it grows without end."""
        power = self
        for _ in range(MOST_DOUBLINGS):
            doubled = power.then(power)
            if not np.isfinite(doubled.Q).all() or np.abs(doubled.Q).max() > UNBOUNDED:
                return None
            deviations = np.sqrt(np.maximum(np.diag(doubled.Q), NOTHING))
            change = np.abs(doubled.Q - power.Q) / np.outer(deviations, deviations)
            power = doubled
            if change.max() < SETTLED:
                return power.Q
        return None


def _symmetric(P: Array) -> Array:
    return 0.5 * (P + P.T)
