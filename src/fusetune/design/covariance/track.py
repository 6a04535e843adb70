"""A way through the air, as an estimator's covariances need it, whoever made it: a simulation, or a log."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusetune.quaternions import normalised, rotation_matrix

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Origin:
    """Where positions of a track are counted from: degrees, and m above mean sea level."""

    lat_deg: float
    lon_deg: float
    alt_m: float


@dataclass(frozen=True)
class Track:
    """Motion at N instants, the estimator's IMU samples.

    Attributes
    ----------
    timestamp_us : (N,) int64, rising
    attitude : (N, 4) unit quaternions w, x, y, z, body to NED
    velocity : (N, 3) m/s NED
    position : (N, 3) m NED from the origin, along the ellipsoid
    specific_force : (N, 3) m/s², body, mean over the interval that ends at the instant
    angular_rate : (N, 3) rad/s, body, against inertial space, the same
    in_air, at_rest : (N,) bool, as the land detector says
    origin : of the positions
    name : for messages and tables
    """

    timestamp_us: npt.NDArray[np.int64]
    attitude: Array
    velocity: Array
    position: Array
    specific_force: Array
    angular_rate: Array
    in_air: npt.NDArray[np.bool_]
    at_rest: npt.NDArray[np.bool_]
    origin: Origin
    name: str = "track"

    def at(self, timestamp_us: npt.NDArray[np.int64], values: Array) -> Array:
        """Values (N, D) between the instants, linear; the first and the last hold outside."""
        return np.stack([np.interp(timestamp_us, self.timestamp_us, column) for column in values.T], axis=-1)

    def attitude_at(self, timestamp_us: npt.NDArray[np.int64]) -> Array:
        """Attitude between the instants, a fraction of a degree apart, as quaternions (M, 4)."""
        signs = np.where(np.sum(self.attitude[1:] * self.attitude[:-1], axis=1) < 0.0, -1.0, 1.0)
        continuous = self.attitude * np.concatenate([[1.0], np.cumprod(signs)])[:, None]
        return np.asarray(normalised(self.at(timestamp_us, continuous)))

    def body_from_ned_at(self, timestamp_us: npt.NDArray[np.int64]) -> Array:
        """Matrices (M, 3, 3) that turn NED into body vectors."""
        return np.swapaxes(rotation_matrix(self.attitude_at(timestamp_us)), -1, -2)
