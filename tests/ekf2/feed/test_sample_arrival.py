"""What parameters said of a sample when it arrived, and of which samples the filter makes use."""

from __future__ import annotations

import numpy as np
import pytest
from tests.ekf2.filter.height_and_field_records import make_estimator

from fusetune.ekf2.feed.sample_arrival import NOTE, apply_antenna_yaw_offset, apply_vision_noise, is_fusion_due
from fusetune.ekf2.feed.sensor_samples import EV_SAMPLE, GNSS_SAMPLE


@pytest.mark.parametrize(("ready", "withheld", "due"), [(True, False, True), (True, True, False), (False,) * 3])
def test_fusion_is_due_of_a_sample_that_is_not_withheld(ready, withheld, due):
    sensor = make_estimator()["sensors"]["mag"]
    sensor["data_ready"], sensor["withheld"] = ready, withheld
    assert is_fusion_due(sensor) == due


def noted_vision(mode: int, position: float, velocity: float, attitude: float) -> np.void:
    """A sample that reports 0.04 of everything, with what the parameters say of it."""
    sample = np.zeros(1, EV_SAMPLE)[0]
    for name in ("position_var", "velocity_var", "orientation_var"):
        sample[name] = 0.04
    apply_vision_noise(sample, np.array((0, 0.0, position, velocity, attitude, mode), NOTE)[()])
    return sample


def test_vision_noise_is_that_of_the_parameters_in_mode_1():
    """0.5² m², 0.4² m²/s², 0.3² rad²."""
    sample = noted_vision(1, 0.5, 0.4, 0.3)
    np.testing.assert_allclose(sample["position_var"], 0.25)
    np.testing.assert_allclose(sample["velocity_var"], 0.16)
    np.testing.assert_allclose(sample["orientation_var"], 0.09)


def test_vision_noise_is_a_floor_to_what_is_reported():
    sample = noted_vision(0, 0.5, 0.1, 0.1)
    np.testing.assert_allclose(sample["position_var"], 0.25)
    np.testing.assert_allclose(sample["velocity_var"], 0.04)


@pytest.mark.parametrize(("offset_deg", "yaw"), [(0.0, 0.3), (90.0, 0.3 - np.pi / 2)])
def test_antenna_yaw_is_turned_by_the_offset(offset_deg, yaw):
    sample = np.zeros(1, GNSS_SAMPLE)[0]
    sample["yaw"], sample["yaw_offset"] = 0.3, np.nan
    note = np.zeros(1, NOTE)[0]
    note["yaw_offset_deg"] = offset_deg
    apply_antenna_yaw_offset(sample, note)
    assert sample["yaw"] == pytest.approx(yaw)
