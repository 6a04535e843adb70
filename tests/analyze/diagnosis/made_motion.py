"""A motion that is known exactly: a vehicle that accelerates, turns and climbs for a minute."""

from __future__ import annotations

import numpy as np

from fusetune.analyze.diagnosis.motion import Motion
from fusetune.ekf2.numerics.constants import ONE_G
from fusetune.quaternions import from_rotation_vector, multiply, rotation_matrix

STEP_US, START_US, SECONDS = 10_000, 20_000_000, 70.0
FLYING = ((START_US + 5_000_000, START_US + 65_000_000),)
HEADING_OFF = 0.4
"""Of NED against the frame of the gyros, rad."""


def made_motion(climbs: bool = True, fast: float = 6.0) -> Motion:
    """On the ground for five seconds, then in the air for a minute, and five seconds on the ground.

    The heading of the gyros' frame is `HEADING_OFF` less than true; the thrust is that of a hover and follows the
    climb.
    """
    count = int(SECONDS * 1e6 / STEP_US)
    time = START_US + STEP_US * np.arange(count, dtype=np.int64)
    since = (time - FLYING[0][0]) * 1e-6
    flying = (since >= 0.0) & (since < 60.0)
    phase = np.where(flying, since, 0.0)
    envelope = np.where(flying, np.minimum(1.0, np.minimum(since, 60.0 - since) / 3.0), 0.0)
    north = envelope * fast * np.sin(2.0 * np.pi * phase / 11.0)
    east = envelope * fast * np.sin(2.0 * np.pi * phase / 7.0)
    down = -envelope * (1.5 * np.sin(2.0 * np.pi * phase / 20.0)) if climbs else np.zeros(count)
    velocity = np.column_stack([north, east, down])
    acceleration = np.gradient(velocity, time * 1e-6, axis=0)
    yaw = envelope * 2.5 * np.sin(2.0 * np.pi * phase / 17.0)
    roll, pitch = (
        0.25 * envelope * np.sin(2.0 * np.pi * phase / 3.0),
        0.2 * envelope * np.sin(2.0 * np.pi * phase / 4.3),
    )
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for axis, angle in ((2, yaw), (1, pitch), (0, roll)):
        vector = np.zeros((count, 3))
        vector[:, axis] = angle
        q = multiply(q, from_rotation_vector(vector))
    true = rotation_matrix(q)
    rate = np.zeros((count, 3))
    turned = np.einsum("nji,njk->nik", true[:-1], true[1:])
    rate[1:] = np.column_stack([turned[:, 2, 1], turned[:, 0, 2], turned[:, 1, 0]]) / (STEP_US * 1e-6)
    force = np.einsum("nji,nj->ni", true, acceleration - np.array([0.0, 0.0, ONE_G]))
    cosine, sine = np.cos(HEADING_OFF), np.sin(HEADING_OFF)
    to_gyros = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    height = np.cumsum(-down) * STEP_US * 1e-6 + 6.0 * envelope
    thrust = np.where(flying, 1.0 - 0.1 * down, 0.0)
    off = np.full(count, HEADING_OFF)
    return Motion(time, to_gyros @ true, off, velocity, velocity @ to_gyros.T, rate, force, height, thrust, "made")


def true_rotation(motion: Motion) -> np.ndarray:
    """Body → NED, (N, 3, 3)."""
    cosine, sine = np.cos(HEADING_OFF), np.sin(HEADING_OFF)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]) @ motion.rotation
