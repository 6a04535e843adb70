"""Lever arms against the cross product as NumPy has it."""

from __future__ import annotations

import numpy as np
from tests.ekf2.filter.height_and_field_records import make_parameters

from fusetune.ekf2.numerics.lever_arm import position_relative_to_imu, velocity_of_offset


def test_offset_is_counted_from_the_imu():
    params = make_parameters(EKF2_IMU_POS_X=0.1, EKF2_IMU_POS_Y=-0.2, EKF2_IMU_POS_Z=0.3)
    np.testing.assert_allclose(position_relative_to_imu(params, 1.0, 1.0, 1.0), (0.9, 1.2, 0.7), atol=1e-15)


def test_point_on_a_turning_body_moves_by_rate_cross_arm():
    rate, arm = np.array([0.3, -1.2, 0.7]), np.array([0.5, 0.1, -0.4])
    np.testing.assert_allclose(velocity_of_offset(*rate, *arm), np.cross(rate, arm), atol=1e-15)
