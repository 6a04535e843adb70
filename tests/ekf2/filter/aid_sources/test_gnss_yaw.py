"""Expected values: numerical differentiation of the observation by the attitude error."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusetune.ekf2.filter.aid_sources.gnss.gnss_yaw_control import gnss_yaw_innovation_variance, predict_gnss_yaw
from fusetune.ekf2.numerics.rotations import quat_normalise, quat_to_dcm, rotate_by_earth_increment, wrap_pi

angles = st.floats(-1.2, 1.2)
components = st.floats(-1.0, 1.0)


def yaw_of(q, offset):
    R = np.empty((3, 3))
    quat_to_dcm(q, R)
    return predict_gnss_yaw(R, offset, np.empty(24))


@settings(deadline=None)
@given(components, components, components, components, st.floats(-3.0, 3.0))
def test_jacobian_is_the_derivative_by_the_attitude_error(w, x, y, z, offset):
    q = np.array([w, x, y, z])
    if np.linalg.norm(q) < 0.1:
        return
    quat_normalise(q)
    R, H = np.empty((3, 3)), np.full(24, 7.0)
    quat_to_dcm(q, R)
    predicted = predict_gnss_yaw(R, offset, H)
    baseline = R @ np.array([math.cos(offset), math.sin(offset), 0.0])
    # near the vertical, and next to the arctangent's guard, the difference quotient says nothing
    if abs(baseline[2]) > 0.95 or abs(baseline[0]) < 1e-3:
        return
    step = 1e-6
    for axis in range(3):
        error = np.zeros(3)
        error[axis] = step
        plus, minus = q.copy(), q.copy()
        rotate_by_earth_increment(plus, *error)
        rotate_by_earth_increment(minus, *-error)
        slope = wrap_pi(yaw_of(plus, offset) - yaw_of(minus, offset)) / (2.0 * step)
        assert H[axis] == pytest.approx(slope, abs=1e-4 * (1.0 + abs(slope)))
    assert not H[3:].any()
    assert abs(predicted) <= math.pi


def test_a_level_vehicle_sees_its_yaw_plus_the_offset():
    yaw, offset = 0.8, 1.1
    q = np.array([math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)])
    assert yaw_of(q, offset) == pytest.approx(yaw + offset, abs=1e-6)


def test_innovation_variance_is_the_quadratic_form():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(24, 24))
    P = root @ root.T
    H = np.zeros(24)
    H[:3] = 0.3, -0.7, 1.0
    assert gnss_yaw_innovation_variance(P, H, 0.01) == pytest.approx(H @ P @ H + 0.01)


def test_a_vertical_baseline_has_next_to_no_weight():
    """The innovation variance of a baseline along the vertical is beyond 1e6 rad², so the Kalman gain vanishes."""
    q = np.array([math.cos(math.pi / 4.0), 0.0, -math.sin(math.pi / 4.0), 0.0])
    R, H = np.empty((3, 3)), np.empty(24)
    quat_to_dcm(q, R)
    predict_gnss_yaw(R, 0.0, H)
    assert gnss_yaw_innovation_variance(np.eye(24), H, 0.09) > 1e6
