"""The four-state filter of a multirotor that lands on a marker, known by name to designs.

From the article "Sensor fusion: be sure of uncertainty" (A. Baeyens, 2024). It publishes results and not the figures of
its IMU; the defaults here reproduce every result and are a reference point, not the author's values.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusetune.design.covariance.linear_model import LinearModel, LinearSensor, State
from fusetune.settings.declaration import setting


@dataclass(frozen=True)
class MarkerLanding:
    """Vehicle above a marker, with camera, gyro and accelerometer; small angles."""

    height_m: float = setting(2.0, "height above the marker (the article's p_y)", unit="m", above=0)
    pixel_variance: float = setting(1.0, "variance of the marker's place in the picture", unit="px²", above=0)
    focal_length_px: float = setting(645.0, "focal length", unit="px", above=0)
    marker_rate_hz: float = setting(5.0, "rate at which the marker is seen", unit="Hz", low=0.01, high=1e5)
    gyro_density: float = setting(0.0095, "white noise of the gyro", unit="rad/s/√Hz", low=0)
    accelerometer_density: float = setting(0.11, "white noise of the accelerometer", unit="m/s²/√Hz", low=0)
    gyro_bias_density: float = setting(1e-4, "random walk of the gyro's bias", unit="rad/s²/√Hz", low=0)
    gravity_m_s2: float = setting(9.81, "gravity", unit="m/s²", above=0)
    step_rate_hz: float = setting(
        200.0, "rate of the propagation (the article's f_prop)", unit="Hz", low=0.01, high=1e5
    )


def marker_landing(values: MarkerLanding) -> LinearModel:
    """States p_x, θ, v_x, b_ω: ṗ = v, θ̇ = ω − b, v̇ = a − gθ, and the marker is seen at p_x + p_y θ.

    Propagation is I + A/f_prop with Q/f_prop, the measurement's variance v_p (p_y/f)².
    """
    A = np.zeros((4, 4))
    A[0, 2], A[1, 3], A[2, 1] = 1.0, -1.0, -values.gravity_m_s2
    variance = values.pixel_variance * (values.height_m / values.focal_length_px) ** 2
    densities = {
        "gyro": (1, values.gyro_density),
        "accelerometer": (2, values.accelerometer_density),
        "gyro_bias": (3, values.gyro_bias_density),
    }
    return LinearModel(
        states=(State("p_x", "m"), State("theta", "rad"), State("v_x", "m/s"), State("b_omega", "rad/s")),
        A=A,
        step_rate_hz=values.step_rate_hz,
        noises={name: np.diag(np.eye(4)[place] * density**2) for name, (place, density) in densities.items()},
        sensors={
            "marker": LinearSensor(
                np.array([[1.0, values.height_m, 0.0, 0.0]]), np.array([[variance]]), values.marker_rate_hz
            )
        },
        P0=np.eye(4),
    )
