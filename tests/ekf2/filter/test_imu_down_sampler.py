"""IMU down-sampling: rotation against SciPy, time stamps against PX4's own estimator."""

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.spatial.transform import Rotation

from fusetune.ekf2.feed.inputs import build_inputs
from fusetune.ekf2.feed.sensor_samples import IMU_SAMPLE
from fusetune.ekf2.filter.common.parameters import complete, parameter_record
from fusetune.ekf2.filter.imu_down_sampler.imu_down_sampler import (
    DOWN_SAMPLER_MEMORY,
    accumulate_imu,
    initialise_down_sampler,
    reset_down_sampler,
)
from fusetune.ekf2.replay.flight_schedule import flight_schedule
from fusetune.px4.layouts.release_layouts import canonical
from fusetune.px4.ulog.reader import read_ulog

DT = np.float32(0.004)


def constant_motion(count, rate, acceleration):
    imu = np.zeros(count, IMU_SAMPLE)
    imu["time_us"] = 1_000_000 + 4000 * np.arange(count)
    imu["delta_ang"] = np.asarray(rate) * DT
    imu["delta_vel"] = np.asarray(acceleration) * DT
    imu["delta_ang_dt"] = imu["delta_vel_dt"] = DT
    return imu


def down_sampled(imu, predict_us):
    sampler = np.zeros(1, DOWN_SAMPLER_MEMORY)
    initialise_down_sampler(sampler[0])
    out = []
    for sample in imu:
        if accumulate_imu(sampler[0], sample):
            out.append(sampler[0]["sample"].copy())
            reset_down_sampler(sampler[0], predict_us)
    return out


def test_rotation_of_a_coning_motion_is_the_product_of_its_parts():
    imu = constant_motion(60, (0, 0, 0), (0, 0, -9.8))
    phase = np.linspace(0, 6, 60)
    imu["delta_ang"] = 0.02 * np.column_stack([np.cos(phase), np.sin(phase), np.full(60, 0.1)])
    total = Rotation.identity()
    for sample in down_sampled(imu, 20_000):
        total = total * Rotation.from_rotvec(sample["delta_ang"])
    consumed = sum(round(float(sample["delta_ang_dt"] / DT)) for sample in down_sampled(imu, 20_000))
    expected = Rotation.identity()
    for increment in imu["delta_ang"][:consumed]:
        expected = expected * Rotation.from_rotvec(increment)
    assert (total * expected.inv()).magnitude() < 1e-12


def test_interval_settles_on_the_samples_that_fill_the_period():
    samples = down_sampled(constant_motion(400, (0, 0, 0.1), (0, 0, 0)), 8000)
    counts = [round(float(sample["delta_ang_dt"] / DT)) for sample in samples]
    assert set(counts[5:]) == {2}


@pytest.mark.parametrize(("predict_us", "later"), [(5000, 1), (10_000, 2), (20_000, 5)])
def test_first_interval_has_the_default_length(predict_us, later):
    """PX4's down-sampler exists before parameters are bound, so its first interval aims at 10 ms: two samples of its
    initial mean of 5 ms. With the true 4 ms, three samples are the first to exceed 10 ms, two the first to make 2
    samples in more than 5 ms; afterwards EKF2_PREDICT_US / 4 ms, rounded, samples fill an interval.
    """
    counts = [
        round(float(sample["delta_ang_dt"] / DT))
        for sample in down_sampled(constant_motion(400, (0, 0, 0.1), (0, 0, 0)), predict_us)
    ]
    assert counts[0] == 2
    assert set(counts[20:]) == {later}


def test_velocity_without_rotation_is_the_plain_sum():
    for sample in down_sampled(constant_motion(50, (0, 0, 0), (1.0, -2.0, 3.0)), 10_000):
        np.testing.assert_allclose(sample["delta_vel"], np.array([1.0, -2.0, 3.0]) * sample["delta_vel_dt"], rtol=1e-6)


@pytest.mark.parametrize("name", ["JAParedes__TestFlight1", "erdemarslan380__sitl_max_80"])
def test_fusion_time_horizon_is_that_of_px4(shared_logs, shared_reference, name):
    """Expected: time stamps of every update of PX4 v1.16's own EKF2 on the same log."""
    flight = read_ulog(shared_logs / f"{name}.ulg")
    inputs = build_inputs(canonical(flight))
    params = parameter_record(complete(flight.parameters.initial, {}, flight.release))
    tables = flight_schedule(inputs, params[0], ()).tables
    newest = np.arange(len(tables.intervals))
    oldest = np.maximum(newest - int(tables.lengths["imu_length"][0]) + 1, 0)
    times = tables.intervals["time_us"]
    expected = pq.read_table(
        shared_reference / name / "deep" / "estimator_states.parquet", columns=["timestamp", "timestamp_sample"]
    )
    np.testing.assert_array_equal(times, expected["timestamp"].to_numpy())
    np.testing.assert_array_equal(times[oldest], expected["timestamp_sample"].to_numpy())
