"""Strap-down navigation for tests, apart from the simulator: curvilinear position, local NED axes, plain floats.

P. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd edition, section 5.4, with
the attitude kept as a quaternion and gravity from the Somigliana formula with the free-air gradient of GRS80.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

A = 6378137.0
E2 = 6.69437999014e-3
RATE = 7.292115e-5


@dataclass
class Navigation:
    lat: float
    lon: float
    height: float
    velocity: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]

    def step(self, delta_angle: tuple[float, ...], delta_velocity: tuple[float, ...], dt: float) -> None:
        sin_lat, cos_lat = math.sin(self.lat), math.cos(self.lat)
        root = math.sqrt(1.0 - E2 * sin_lat**2)
        normal, meridian = A / root, A * (1.0 - E2) / root**3
        vn, ve, vd = self.velocity
        earth = (RATE * cos_lat, 0.0, -RATE * sin_lat)
        transport = (
            ve / (normal + self.height),
            -vn / (meridian + self.height),
            -ve * math.tan(self.lat) / (normal + self.height),
        )
        frame_rate = tuple(e + t for e, t in zip(earth, transport, strict=True))
        sweep = tuple(2.0 * e + t for e, t in zip(earth, transport, strict=True))
        coriolis = cross(sweep, self.velocity)
        half = tuple(0.5 * v for v in cross(delta_angle, delta_velocity))
        force = rotate(self.quaternion, tuple(v + h for v, h in zip(delta_velocity, half, strict=True)))
        gravity = 9.7803253359 * (1.0 + 0.00193185265241 * sin_lat**2) / root - 3.0877e-6 * self.height
        new = (
            vn + force[0] - coriolis[0] * dt,
            ve + force[1] - coriolis[1] * dt,
            vd + force[2] - coriolis[2] * dt + gravity * dt,
        )
        mean = tuple(0.5 * (a + b) for a, b in zip(self.velocity, new, strict=True))
        # The second-order term of position over a step is that of a constant acceleration
        self.lat += mean[0] * dt / (meridian + self.height)
        self.lon += mean[1] * dt / ((normal + self.height) * cos_lat)
        self.height -= mean[2] * dt
        self.velocity = new
        frame_turn = tuple(-w * dt for w in frame_rate)
        self.quaternion = multiply(multiply(from_vector(frame_turn), self.quaternion), from_vector(delta_angle))


def cross(a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def multiply(p: tuple[float, ...], q: tuple[float, ...]) -> tuple[float, float, float, float]:
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


def from_vector(v: tuple[float, ...]) -> tuple[float, float, float, float]:
    angle = math.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
    scale = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    return math.cos(0.5 * angle), v[0] * scale, v[1] * scale, v[2] * scale


def rotate(q: tuple[float, ...], v: tuple[float, ...]) -> tuple[float, ...]:
    conjugate = (q[0], -q[1], -q[2], -q[3])
    return multiply(multiply(q, (0.0, *v)), conjugate)[1:]
