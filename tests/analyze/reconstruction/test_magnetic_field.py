"""Telling the earth's field from the body's in noisy samples, and smoothing what is left."""

import numpy as np

from fusetune.analyze.reconstruction.attitude import to_body, to_earth
from fusetune.analyze.reconstruction.magnetic_field import magnetic_field
from fusetune.quaternions import from_rotation_vector, multiply

EARTH = np.array([0.21, 0.03, 0.43])
BODY = np.array([0.02, -0.015, 0.01])
NOISE = 0.004
SAMPLES = 300
TIME = 500_000 * np.arange(SAMPLES)


def attitudes(tilt: float) -> np.ndarray:
    """Two turns to the left while the vehicle leans to one side, then to the other, by up to `tilt` rad."""
    share = np.arange(SAMPLES) / SAMPLES
    zero = np.zeros(SAMPLES)
    lean = from_rotation_vector(np.stack([tilt * np.sin(37.0 * share), tilt * np.cos(23.0 * share), zero], axis=1))
    turn = from_rotation_vector(np.stack([zero, zero, -4.0 * np.pi * share], axis=1))
    return multiply(turn, lean)


def samples(q: np.ndarray, noise: float = NOISE) -> np.ndarray:
    random = np.random.default_rng(2)
    return to_body(q, np.tile(EARTH, (len(q), 1))) + BODY + noise * random.standard_normal((len(q), 3))


def test_both_fields_are_found_under_noise():
    """The horizontal axes turn fully: σ / √N. Down shows through the lean alone: σ / √(N · mean sin²)."""
    q = attitudes(0.3)
    found = magnetic_field(TIME, q, samples(q))
    across = NOISE / np.sqrt(SAMPLES)
    np.testing.assert_allclose(found.body[:2], BODY[:2], atol=4 * across)
    np.testing.assert_allclose(found.body[2], BODY[2], atol=4 * across / 0.3)
    np.testing.assert_allclose(found.earth, np.tile(EARTH, (SAMPLES, 1)), atol=4 * across / 0.3)


def test_a_body_field_that_does_not_show_is_taken_to_be_none():
    """Yaw alone shows two axes; the third is indistinguishable from the earth's and stays with it."""
    q = attitudes(0.0)
    found = magnetic_field(TIME, q, samples(q))
    np.testing.assert_allclose(found.body[:2], BODY[:2], atol=0.002)
    assert abs(found.body[2]) < 1e-6
    np.testing.assert_allclose(found.earth[:, 2], EARTH[2] + BODY[2], atol=0.002)


def test_a_level_vehicle_at_rest_shows_no_body_field():
    q = np.tile([1.0, 0.0, 0.0, 0.0], (SAMPLES, 1))
    found = magnetic_field(TIME, q, samples(q))
    np.testing.assert_allclose(found.body, 0.0, atol=1e-9)


def test_a_field_that_wanders_without_noise_is_followed():
    q = attitudes(0.0)
    random = np.random.default_rng(6)
    walk = EARTH + np.cumsum(0.004 * random.standard_normal((SAMPLES, 3)), axis=0)
    measured = to_body(q, walk) + BODY
    found = magnetic_field(TIME, q, measured)
    # the fields together explain the samples, however they are shared out
    np.testing.assert_allclose(to_body(q, found.earth) + found.body, measured, atol=0.004)


def test_few_samples_are_taken_as_they_are():
    q = attitudes(0.3)[:20]
    measured = samples(q)
    found = magnetic_field(TIME[:20], q, measured)
    np.testing.assert_array_equal(found.earth, to_earth(q, measured))
    np.testing.assert_array_equal(found.body, 0.0)
