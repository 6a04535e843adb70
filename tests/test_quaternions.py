"""Quaternions in arrays against SciPy's rotations, which write the scalar last unless told otherwise."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fusetune import quaternions

numbers = st.floats(-3.0, 3.0)
vectors = st.lists(st.tuples(numbers, numbers, numbers), min_size=1, max_size=5).map(np.array)


def quaternions_of(rotations: Rotation) -> np.ndarray:
    return rotations.as_quat(scalar_first=True)


@given(vectors)
def test_rotation_vector_to_quaternion_and_back(vector):
    q = quaternions.from_rotation_vector(vector)
    as_matrix = Rotation.from_rotvec(vector).as_matrix()
    np.testing.assert_allclose(quaternions.rotation_matrix(q), as_matrix, atol=1e-12)
    back = Rotation.from_rotvec(quaternions.rotation_vector(q)).as_matrix()
    np.testing.assert_allclose(back, as_matrix, atol=1e-7)


@given(vectors, st.integers(0, 2**32 - 1))
def test_product_turns_by_the_second_first(vector, seed):
    first, second = Rotation.random(len(vector), rng=np.random.default_rng(seed)), Rotation.from_rotvec(vector)
    product = quaternions.multiply(quaternions_of(second), quaternions_of(first))
    np.testing.assert_allclose(quaternions.rotation_matrix(product), (second * first).as_matrix(), atol=1e-12)


def test_conjugate_turns_back():
    q = quaternions.normalised(np.array([[1.0, 2.0, 3.0, 4.0], [-1.0, 0.5, 0.0, 2.0]]))
    unit = quaternions.multiply(q, quaternions.conjugate(q))
    np.testing.assert_allclose(unit, np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)), atol=1e-15)


def test_one_quaternion_is_taken_like_many():
    q = quaternions_of(Rotation.random(3, rng=np.random.default_rng(1)))
    for one, matrix in zip(q, quaternions.rotation_matrix(q), strict=True):
        np.testing.assert_array_equal(quaternions.rotation_matrix(one), matrix)
