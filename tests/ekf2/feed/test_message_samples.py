"""Conversion of PX4 messages to samples; expected values follow from the rules of PX4's EKF2 module by hand."""

import numpy as np
import pytest

from fusetune.ekf2.feed import message_samples as convert
from fusetune.px4.sample_times import measurement_time


def table(**columns):
    return {name.replace("__", "[") + ("]" if "__" in name else ""): np.array(v) for name, v in columns.items()}


def test_imu_integrals_use_single_precision_intervals():
    rows = table(
        timestamp=[5000],
        gyro_integral_dt=np.array([4000], np.uint32),
        accelerometer_integral_dt=np.array([4100], np.uint32),
        gyro_rad__0=[1.0], gyro_rad__1=[0.0], gyro_rad__2=[-2.0],
        accelerometer_m_s2__0=[0.0], accelerometer_m_s2__1=[0.0], accelerometer_m_s2__2=[-10.0],
        accelerometer_clipping=[5],
    )  # fmt: skip
    sample = convert.imu_samples(rows)[0]
    assert sample["delta_ang_dt"] == np.float32(4000) * np.float32(1e-6)
    assert sample["delta_vel"][2] == pytest.approx(-10.0 * 0.0041, rel=1e-7)
    assert sample["delta_vel_clipping"].tolist() == [1, 0, 1]


def test_new_device_or_calibration_resets_the_magnetometer_bias():
    rows = table(
        timestamp=[1, 2, 3, 4], device_id=[7, 7, 8, 8], calibration_count=[0, 0, 0, 1],
        magnetometer_ga__0=[0.0] * 4, magnetometer_ga__1=[0.0] * 4, magnetometer_ga__2=[0.0] * 4,
    )  # fmt: skip
    assert convert.mag_samples(rows)["reset"].tolist() == [True, False, True, True]


def test_sample_time_falls_back_to_the_time_of_publication():
    stamps = table(timestamp=[10, 20], timestamp_sample=[7, 0])
    assert measurement_time("vehicle_magnetometer", stamps).tolist() == [7, 20]
    assert measurement_time("vehicle_magnetometer", table(timestamp=[10])).tolist() == [10]
    assert measurement_time("vehicle_gps_position", stamps).tolist() == [10, 20]


def test_gnss_velocity_must_be_valid_and_dilution_combines_both_directions():
    rows = table(
        timestamp=[1, 2], latitude_deg=[47.0, 47.0], longitude_deg=[8.0, 8.0], altitude_msl_m=[400.0, 400.0],
        vel_n_m_s=[0.0, 0.0], vel_e_m_s=[0.0, 0.0], vel_d_m_s=[0.0, 0.0], hdop=[3.0, 3.0], vdop=[4.0, 4.0],
        vel_ned_valid=[True, False], spoofing_state=[3, 1],
    )  # fmt: skip
    samples, usable = convert.gnss_samples(rows), convert.taken(rows, convert.gnss_refusals(rows))
    assert samples["pdop"].tolist() == [5.0, 5.0]
    assert usable.tolist() == [True, False]
    assert samples["spoofed"].tolist() == [True, False]


def test_flow_turns_round_becomes_a_rate_and_is_stamped_mid_interval():
    rows = table(
        timestamp=[100_000], timestamp_sample=[90_000], pixel_flow__0=[0.02], pixel_flow__1=[-0.01],
        delta_angle__0=[0.0], delta_angle__1=[0.1], delta_angle__2=[0.0], integration_timespan_us=[20_000],
        quality=[200], max_flow_rate=[7.0], min_ground_distance=[0.1], max_ground_distance=[30.0],
    )  # fmt: skip
    samples, limits = convert.flow_samples(rows)
    np.testing.assert_allclose(samples["flow_rate"][0], [-1.0, 0.5])
    assert samples["gyro_rate"][0][1] == pytest.approx(-5.0)
    assert samples["time_us"][0] == 80_000
    # the sensor's limits and the time that it integrated (µs)
    assert limits.tolist() == [[7.0, 0.1, 30.0, 20_000.0]]
    assert convert.taken(rows, convert.flow_refusals(rows)).all()


def vision(**changes):
    base = {
        "timestamp": [10], "timestamp_sample": [9], "pose_frame": [1], "velocity_frame": [3], "quality": [50],
        "reset_counter": [2], "q__0": [1.0], "q__1": [0.0], "q__2": [0.0], "q__3": [0.0],
    }  # fmt: skip
    for name in ("position", "velocity", "position_variance", "velocity_variance", "orientation_variance"):
        base |= {f"{name}__{i}": [0.25] for i in range(3)}
    return table(**(base | changes))


def test_vision_parts_that_are_not_valid_are_left_out():
    samples, usable = convert.vision_samples(vision(pose_frame=[0], q__0=[1.1]))
    assert np.isnan(samples["pos"]).all()
    assert np.isnan(samples["quat"]).all()
    assert np.isfinite(samples["vel"]).all()
    assert usable.all()
    _, usable = convert.vision_samples(vision(pose_frame=[0], velocity_frame=[0], q__0=[0.0]))
    assert not usable.any()


def test_validated_airspeed_needs_a_selected_sensor():
    rows = table(
        timestamp=[1, 2], true_airspeed_m_s=[22.0, 22.0], calibrated_airspeed_m_s=[20.0, np.nan],
        selected_airspeed_index=[1, 0],
    )  # fmt: skip
    assert convert.validated_airspeed_samples(rows)["eas2tas"].tolist() == [pytest.approx(1.1), 1.0]
    assert convert.taken(rows, convert.validated_airspeed_refusals(rows)).tolist() == [True, False]
