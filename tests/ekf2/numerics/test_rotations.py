"""Rotations against SciPy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fusetune.ekf2.numerics.rotations import (
    dcm_to_quat,
    euler_yaw,
    quat_aligning_with_up,
    quat_multiply,
    quat_multiply_inverse,
    quat_to_dcm,
    quat_to_rotation_vector,
    rotate_by_body_increment,
    rotate_by_earth_increment,
    update_yaw_in_rot_mat,
    wrap_pi,
)

component = st.floats(-1, 1).filter(lambda x: abs(x) > 1e-3)
quaternions = st.tuples(component, component, component, component).map(lambda q: np.array(q) / np.linalg.norm(q))
increments = st.tuples(*3 * (st.floats(-1, 1),)).map(np.array)


def as_rotation(q):
    return Rotation.from_quat(q, scalar_first=True)


@given(q=quaternions, step=increments)
@settings(max_examples=100, deadline=None)
def test_quaternions_and_matrices(q, step):
    R, back = np.empty((3, 3)), np.empty(4)
    quat_to_dcm(q, R)
    np.testing.assert_allclose(R, as_rotation(q).as_matrix(), atol=1e-12)
    dcm_to_quat(R, back)
    np.testing.assert_allclose(abs(back @ q), 1.0, atol=1e-12)

    body, earth = q.copy(), q.copy()
    rotate_by_body_increment(body, *step)
    np.testing.assert_allclose(
        as_rotation(body).as_matrix(), (as_rotation(q) * Rotation.from_rotvec(step)).as_matrix(), atol=1e-12
    )
    rotate_by_earth_increment(earth, *step)
    np.testing.assert_allclose(
        as_rotation(earth).as_matrix(), (Rotation.from_rotvec(step) * as_rotation(q)).as_matrix(), atol=1e-12
    )


@given(a=quaternions, b=quaternions)
@settings(max_examples=50, deadline=None)
def test_products(a, b):
    product, quotient = np.empty(4), np.empty(4)
    quat_multiply(a, b, product)
    np.testing.assert_allclose(
        as_rotation(product).as_matrix(), (as_rotation(a) * as_rotation(b)).as_matrix(), atol=1e-12
    )
    quat_multiply_inverse(product, b, quotient)
    np.testing.assert_allclose(quotient, a, atol=1e-12)


@given(step=increments.filter(lambda v: np.linalg.norm(v) > 1e-6))
@settings(max_examples=50, deadline=None)
def test_rotation_vector_of_a_quaternion(step):
    q = Rotation.from_rotvec(step).as_quat(scalar_first=True)
    np.testing.assert_allclose(quat_to_rotation_vector(q), step, atol=1e-10)


@given(q=quaternions, yaw=st.floats(-3.1, 3.1))
@settings(max_examples=100, deadline=None)
def test_new_yaw_keeps_the_tilt(q, yaw):
    R, out = as_rotation(q).as_matrix(), np.empty((3, 3))
    update_yaw_in_rot_mat(yaw, R, out)
    np.testing.assert_allclose(out[2], R[2], atol=1e-9)
    np.testing.assert_allclose(out @ out.T, np.eye(3), atol=1e-9)
    assert wrap_pi(euler_yaw(out) - yaw) == pytest.approx(0.0, abs=1e-9)


def test_yaw_uses_the_sequence_away_from_its_singularity():
    rolled = Rotation.from_euler("ZYX", [0.4, 0.1, 0.5])
    assert euler_yaw(rolled.as_matrix()) == pytest.approx(0.4)
    pitched = Rotation.from_euler("ZXY", [0.4, 0.1, 1.2])
    assert euler_yaw(pitched.as_matrix()) == pytest.approx(0.4)


@given(force=st.tuples(component, component, component).map(np.array))
@settings(max_examples=50, deadline=None)
def test_levelling_points_the_specific_force_up(force):
    q = np.empty(4)
    quat_aligning_with_up(*force, q)
    np.testing.assert_allclose(as_rotation(q).apply(force), [0, 0, -np.linalg.norm(force)], atol=1e-9)


def test_levelling_upside_down():
    q = np.empty(4)
    quat_aligning_with_up(0.0, 0.0, 9.8, q)
    np.testing.assert_allclose(as_rotation(q).apply([0, 0, 9.8]), [0, 0, -9.8], atol=1e-12)


@given(angle=st.floats(-50, 50))
def test_wrap(angle):
    wrapped = wrap_pi(angle)
    assert -math.pi <= wrapped < math.pi
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)
